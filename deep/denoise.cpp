#include "deep/denoise.h"

#include <chrono>
#include <cmath>

#include "deep/bin_mix.h"
#include "deep/compose.h"
#include "deep/consistency.h"
#include "deep/denoise_data.h"
#include "deep/feature_prefilter.h"
#include "deep/filter_bank.h"
#include "deep/flatten.h"
#include "deep/gate.h"
#include "deep/noise_response.h"
#include "deep/still.h"
#include "flat/level.h"

namespace fathom::deep {

namespace {

// Writes the seconds since the last lap under a stage's name.
class Clock {
 public:
  explicit Clock(DenoiseStats& stats) : stats_(stats) {}
  double lap(const char* stage) {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    stats_.seconds[stage] += seconds;
    last_ = now;
    return seconds;
  }

 private:
  DenoiseStats& stats_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

bool isStatistic(const std::string& channel) {
  return channel.starts_with("half0.") || channel.starts_with("half1.") || channel.starts_with("variance.") ||
         channel == "samples";
}

// Drops channels that describe the noisy colours; `last` keeps those that a later stage still reads.
void dropStatistics(DeepImage& image, const DenoiseParams& params, bool last) {
  if (params.keepStatistics) return;
  std::erase_if(image.channels, [&](const Channel& c) {
    const bool gateReads = c.name == "variance.R" || c.name == "variance.G" || c.name == "variance.B";
    return isStatistic(c.name) && (last || !gateReads);
  });
}

void countPixels(const DenoiseData& data, const Activity& activity, DenoiseStats& stats) {
  uint64_t empty = 0, still = 0, single = 0;
  const size_t pixels = size_t(data.width) * size_t(data.height);
  for (size_t p = 0; p < pixels; ++p) {
    const uint64_t bins = data.offsets[p + 1] - data.offsets[p];
    empty += bins == 0;
    single += bins == 1;
    still += bins > 0 && activity.still[p];
  }
  stats.counts["pixels"] += pixels;
  stats.counts["pixels empty"] += empty;
  stats.counts["pixels kept: nothing noisy"] += still;
  stats.counts["pixels with one bin"] += single;
  stats.counts["bins"] += data.bins();
  stats.counts["non-finite samples"] += data.nonFinite;
}

// What was skipped, and what it would have cost at the price of what was not.
void tell(const FilterCounts& counts, double seconds, DenoiseStats& stats) {
  stats.counts["tiles"] += counts.tiles;
  stats.counts["tiles skipped: nothing noisy"] += counts.tilesStill;
  stats.counts["tiles where a component has no light"] += counts.tilesDark;
  stats.counts["bins filtered"] += counts.binsFiltered;
  stats.counts["bins skipped"] += counts.binsSkipped;
  if (counts.binsFiltered > 0)
    stats.seconds["filter: saved by skipping"] += seconds * double(counts.binsSkipped) / double(counts.binsFiltered);
}

}  // namespace

DeepImage denoise(DeepImage image, const DenoisePlan& plan, const Progress& progress, DenoiseStats* statsOut,
                  const BaseGuide* guide, flat::NoiseResponse* response) {
  DenoiseStats unwanted;
  DenoiseStats& stats = statsOut ? *statsOut : unwanted;
  Clock clock(stats);
  progress.at(0);
  DenoiseData data = prepareColours(image, plan.inputs);
  clock.lap("prepare");
  const std::vector<FilterPass> passes = filterPasses(plan);
  std::vector<ComponentGuide> guides;
  for (const DenoiseComponent& component : data.components)
    guides.push_back(colourGuide(data, component, passes.front().guideBorder()));
  const Activity activity = findActivity(data, guides, image, plan.inputs, passes.back().radius(), plan.level);
  const auto ofPixels = pixelVariance(data, guides, plan.inputs);
  countPixels(data, activity, stats);
  clock.lap("guides");
  progress.at(0.05);
  int reach = 0;  // of the bank's windows, and a pixel more for gradients
  for (const FilterPass& pass : passes) reach = std::max(reach, pass.radius() + 1);
  prepareFeatures(image, plan.inputs, allWithin(activity.still, data.width, data.height, featureReach(reach)), data);
  HalfDifferences differences;
  if (response) {
    differences = halfDifferences(image, plan.inputs, data);
    if (plan.inputs.albedo) data.albedo.own = Buffer<float>(data.bins(), 1.0f);
  }
  dropStatistics(image, plan.params, false);
  clock.lap("prepare");
  prefilterFeatures(data, activity, reach);
  clock.lap("prefilter");
  progress.at(0.15);

  FilterCounts counts;
  const Progress filterProgress{[&](double done) { progress.at(0.15 + 0.7 * done); }, progress.stop};
  std::vector<HalfAnswer> answers;
  std::vector<Buffer<float>> filtered = filterColours(data, std::move(guides), activity, passes, plan.level,
                                                      filterProgress, counts, response ? &answers : nullptr);
  tell(counts, clock.lap("filter"), stats);

  Buffer<GateBin> bins = compose(image, data, plan.inputs, activity.still, ofPixels, filtered);
  clock.lap("compose");
  if (guide && !guide->bins.empty()) {
    const Buffer<float> second = fromBinImages(image, guide->bins);
    mixBins(data, second, activity.still, plan.level, guide->consistency.binPrior, bins);
  }
  clock.lap("mix");
  const bool gated = plan.params.gate && plan.params.filter == FilterKind::Own;
  const Buffer<flat::GateVerdict> gates =
      gated ? gate(data, bins, activity.still, plan.level) : Buffer<flat::GateVerdict>(data.bins(), {});
  clock.lap("gate");
  if (response) {
    *response = noiseResponse({image, plan.inputs, data, differences, answers, filtered, bins, gates, activity.still});
    clock.lap("error");
  }
  Buffer<float> colours;
  if (guide) {
    colours = gatedColours(data, bins, gates, activity.still);
    makeConsistent(image, data, *guide, gates, activity.still, plan.level, colours);
  }
  clock.lap("consistency");
  writeColours(image, data, activity.still, filtered, gates, colours);
  dropStatistics(image, plan.params, true);
  clock.lap("compose");
  progress.at(1);
  return image;
}

void addLevel(const DeepImage& rows, flat::LevelSum& level) {
  const flat::Image flattened = flatten(rows);
  const flat::Plane& alpha = flattened.get("A");
  const std::array<const flat::Plane*, 3> rgb = {&flattened.get("R"), &flattened.get("G"), &flattened.get("B")};
  for (size_t i = 0; i < alpha.values.size(); ++i)
    for (const flat::Plane* plane : rgb)
      if (alpha.values[i] > 0) level.add(double(plane->values[i]));
}

float meanLevel(const DeepImage& image) {
  flat::LevelSum level;
  addLevel(image, level);
  return level.result();
}

int denoiseHalo(const DenoisePlan& plan) {
  // Pass by pass: the guides' rows, pooled (2) and, if nothing tells the noise, estimated (3) or a first pass's result;
  // patches of them, or prefiltered features (window, patch, and a row for the gradient); then the pass's window, the
  // error's and the blend's. The gate's window comes last.
  const int prefilter = kPrefilterRadius + kPrefilterPatchRadius + 1;
  int rows = 3;
  for (const FilterPass& pass : filterPasses(plan))
    rows = kBlendRadius + kErrorRadius + std::max(pass.radius() + prefilter, pass.guideBorder() + 2 + rows);
  // A guide's mix of bins comes before the gate, its mix of pixels after it; where the guide is the same filter on flat
  // pixels, it has a gate of its own, and two rows more tell where its noise is known.
  const int guided = plan.guided ? kGateRadius + kConsistencyRadius + 2 : 0;
  return rows + kGateRadius + guided + 1;
}

}  // namespace fathom::deep
