#include "cli/denoise_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <optional>
#include <set>

#include "base/error.h"
#include "cli/memory_limit.h"
#include "cli/stopwatch.h"
#include "deep/alpha.h"
#include "deep/apply_flat.h"
#include "deep/channels.h"
#include "deep/error_estimate.h"
#include "deep/flat_nl_means.h"
#include "deep/noise_response.h"
#include "flat/level.h"

namespace fathom::cli {

namespace {

constexpr double kGuidePart = 0.4;  // of the progress on a frame that is guided

// What the colours of a whole frame tell, row by row: it may be larger than memory.
class FrameLook {
 public:
  void add(const deep::DeepImage& rows) {
    addLevel(rows, level_);
    pixels_ += rows.pixels();
    samples_ += rows.samples();
    volumes_ = volumes_ || rows.find("ZBack");
    const Buffer<float> share = deep::effectiveAlpha(rows);
    const std::optional<int> spp = rows.attributes.getInt("fathom:spp");
    if (!part_ && !share.empty()) part_ = spp && *spp > 0 ? 1.0f / float(*spp) : share[0];
    for (const float s : share) alike_ += std::abs(s - *part_) <= 1e-3f * *part_;
    for (size_t pixel = 0; pixel < rows.pixels(); ++pixel) filled_ += rows.count(pixel) > 0;
  }

  void tell(SequencePlan& plan) const {
    plan.denoise.level = level_.result();
    plan.pixels = pixels_;
    plan.samples = samples_;
  }

  // Whether every sample is one camera sample: all have the same part of their pixel, of which most have several. So says
  // the channel convention of files of samples; bins of a render differ in how many samples they hold.
  bool holdsCameraSamples() const {
    if (!part_ || volumes_) return false;
    return *part_ <= 0.5f && double(alike_) >= 0.99 * double(samples_) && samples_ >= filled_ * 3 / 2;
  }

 private:
  flat::LevelSum level_;
  std::optional<float> part_;  // of its pixel that a camera sample has
  size_t pixels_ = 0, samples_ = 0, alike_ = 0, filled_ = 0;
  bool volumes_ = false;
};

// The frame in bands of rows that take at most `bytes` where more than one row does. The source is left with the
// channels that this needs.
FrameLook lookAt(FrameSource& source, size_t bytes, std::set<std::string>& notes) {
  source.want([](const std::string& name) {
    return name == "R" || name == "G" || name == "B" || name == "A" || name == "Z" || name == "ZBack";
  });
  const Box window = source.part().dataWindow;
  FrameLook look;
  for (int y = window.y0; y < window.y1;) {
    int height = window.y1 - y;
    while (height > 1 && source.decodedBytes(y, y + height) > bytes) height = (height + 1) / 2;
    look.add(source.read(y, y + height, notes));
    y += height;
  }
  return look;
}

void findInputs(SequencePlan& plan, FrameSource& source) {
  const Box window = source.part().dataWindow;
  const deep::DeepImage row = source.read(window.y0, std::min(window.y0 + 1, window.y1), plan.notes);
  std::vector<std::string> names;
  for (const deep::Channel& channel : row.channels) names.push_back(channel.name);
  for (const char* needed : {"R", "G", "B", "A", "Z"})
    if (std::find(names.begin(), names.end(), needed) == names.end())
      fail("{}, channel {}: expected in a file to denoise, found none", source.path(), needed);
  plan.denoise.inputs = deep::findDenoiseInputs(names, row.attributes);
  for (const std::string& line : deep::describeMissing(plan.denoise.inputs))
    plan.notes.insert(fmt::format("{}: {}", source.path(), line));
}

std::string clusteredNote(const FrameInputs& inputs) {
  return fmt::format("{}: one deep sample per camera sample: clustered into bins first", inputs.main);
}

// Whether a deep frame holds camera samples that can be clustered: what is missing for that is no error here.
bool canBeClustered(const FrameInputs& inputs, const SourceOptions& options) {
  FrameSource source(inputs, options);
  if (!source.deep() || source.hasStatistics() || !source.tellsDepthScale()) return false;
  SequencePlan unused;
  findInputs(unused, source);
  return lookAt(source, decodedLimit(options.memory), unused.notes).holdsCameraSamples();
}

enum class Statistics { None, OfOwnFilter, All };

// Only what is wanted by the denoiser and for the output is read.
void wantInputs(const deep::DenoisePlan& plan, Statistics statistics, FrameSource& source) {
  source.want([plan, statistics](const std::string& name) {
    if (plan.params.keepStatistics || statistics == Statistics::All) return true;
    if (!deep::describesSamples(deep::roleOf(name, deep::PixelType::Float))) return true;
    return statistics == Statistics::OfOwnFilter && deep::denoiseReads(plan.inputs, name);
  });
}

// Another base may take all statistics, or none but what tells errors and what the gate goes by.
Statistics statisticsOf(const SequencePlan& plan) {
  if (!plan.base) return Statistics::OfOwnFilter;
  if (plan.base->readsStatistics) return Statistics::All;
  return plan.errors || plan.base->gated ? Statistics::OfOwnFilter : Statistics::None;
}

SequencePlan planFrom(const FrameInputs& inputs, const SourceOptions& options, const deep::DenoiseParams& params,
                      bool wanted) {
  SequencePlan plan;
  plan.denoise.params = params;
  plan.first = inputs.main;
  FrameSource source(inputs, options);
  plan.deep = source.deep();
  findInputs(plan, source);
  wantInputs(plan.denoise, Statistics::OfOwnFilter, source);
  const Box window = source.part().dataWindow;
  if (wanted && source.hasStatistics() && source.decodedBytes(window.y0, window.y1) <= decodedLimit(options.memory)) {
    plan.firstImage = source.read(plan.notes);
    FrameLook look;
    look.add(*plan.firstImage);
    look.tell(plan);
    return plan;
  }
  const FrameLook look = lookAt(source, decodedLimit(options.memory), plan.notes);
  look.tell(plan);
  plan.cameraSamples = plan.deep && !source.hasStatistics() && look.holdsCameraSamples();
  if (plan.cameraSamples) {
    plan.notes = {clusteredNote(inputs)};
    source.want({});
    source.clusterFirst();
    findInputs(plan, source);
  }
  return plan;
}

// A flat frame with its errors, which our own filter tells by itself.
deep::DeepImage denoiseTelling(deep::DeepImage image, const SequencePlan& plan, const Progress& progress,
                               deep::DenoiseStats* stats) {
  const deep::DeepImage noisy = image.copy();
  flat::NoiseResponse response;
  image = deep::denoise(std::move(image), plan.denoise, progress, stats, nullptr, &response);
  const Stopwatch watch;
  deep::addErrors(noisy, plan.denoise.inputs, std::move(response), image);
  if (stats) stats->seconds["error"] += watch.seconds();
  return image;
}

// A flat frame with its errors, which the base tells beside its colours.
deep::DeepImage applyTelling(deep::DeepImage image, const SequencePlan& plan, const Progress& progress,
                             deep::DenoiseStats* stats) {
  flat::Image errors;
  const flat::Denoiser telling = [&](const flat::Image& noisy, const Progress& inner) {
    flat::Image result = plan.base->denoise(noisy, inner);
    const auto first = std::stable_partition(result.planes.begin(), result.planes.end(), [](const flat::Plane& plane) {
      return !plane.name.starts_with("error.");
    });
    errors.planes.assign(std::make_move_iterator(first), std::make_move_iterator(result.planes.end()));
    result.planes.erase(first, result.planes.end());
    return result;
  };
  image = deep::applyFlat(std::move(image), telling, plan.denoise.params.keepStatistics, progress, stats);
  if (stats && plan.base->addCounts) plan.base->addCounts(stats->counts);
  for (flat::Plane& plane : errors.planes) {
    image.erase(plane.name);
    image.add(plane.name, deep::PixelType::Float).values = std::move(plane.values);
  }
  return image;
}

// A flat frame; with its errors, denoising is half of the progress.
deep::DeepImage denoiseFlat(deep::DeepImage image, const SequencePlan& plan, const Progress& progress,
                            deep::DenoiseStats* stats) {
  if (plan.errors && plan.base && plan.base->tellsErrors) return applyTelling(std::move(image), plan, progress, stats);
  if (plan.errors && runsOf(plan) == 1) return denoiseTelling(std::move(image), plan, progress, stats);
  const deep::DeepImage noisy = plan.errors ? image.copy() : deep::DeepImage();
  const double part = plan.errors ? 0.5 : 1;
  const Progress first{[&](double done) { progress.at(part * done); }, progress.stop};
  image = plan.base
              ? deep::applyFlat(std::move(image), plan.base->denoise, plan.denoise.params.keepStatistics, first, stats)
              : deep::denoise(std::move(image), plan.denoise, first, stats);
  if (stats && plan.base && plan.base->addCounts) plan.base->addCounts(stats->counts);
  if (!plan.errors) return image;
  const Stopwatch watch;
  const Progress second{[&](double done) { progress.at(part + (1 - part) * done); }, progress.stop};
  deep::addErrors(noisy, plan.denoise.inputs, plan.base ? plan.base->denoise : deep::flatNlMeans(plan.denoise), second,
                  image);
  if (stats) stats->seconds["error"] += watch.seconds();
  return image;
}

// A deep frame or a band of it; `guide`: of the whole frame, where one was made.
deep::DeepImage denoiseDeep(deep::DeepImage image, const FrameInputs& inputs, const SequencePlan& plan,
                            const deep::BaseGuide* guide, const Progress& progress, deep::DenoiseStats* stats) {
  if (!plan.guide) return deep::denoise(std::move(image), plan.denoise, progress, stats);
  const Stopwatch watch;
  const Progress first{[&](double done) { progress.at(kGuidePart * done); }, progress.stop};
  const deep::BaseGuide rows = guide ? deep::guideRows(*guide, image.dataWindow.y0, image.dataWindow.y1)
                                     : guideOf(image, *plan.guide, inputs, plan.denoise, first);
  if (stats) stats->seconds["guide"] += watch.seconds();
  const Progress rest{[&](double done) { progress.at(kGuidePart + (1 - kGuidePart) * done); }, progress.stop};
  return deep::denoise(std::move(image), plan.denoise, rest, stats, &rows);
}

// From the first of the frames that can be read; throws what the first one threw where none can.
template <class Plan>
SequencePlan planFromFirst(const std::vector<FrameInputs>& candidates, const Plan& planOf) {
  std::exception_ptr first;
  for (const FrameInputs& inputs : candidates) {
    try {
      return planOf(inputs);
    } catch (const Error& e) {
      if (!first) first = std::make_exception_ptr(Error(namingFile(e.what(), inputs.files())));
    }
  }
  if (first) std::rethrow_exception(first);
  fail("expected a frame to plan from, found none");
}

}  // namespace

SequencePlan planSequence(const std::vector<FrameInputs>& candidates, const SourceOptions& options,
                          const deep::DenoiseParams& params, const std::string& wanted) {
  return planFromFirst(
      candidates, [&](const FrameInputs& inputs) { return planFrom(inputs, options, params, inputs.main == wanted); });
}

SequencePlan planLayered(const std::vector<FrameInputs>& candidates, const SourceOptions& options,
                         const LayersPlan& layers) {
  return planFromFirst(candidates, [&](const FrameInputs& inputs) {
    SequencePlan plan;
    plan.first = inputs.main;
    plan.layers = layers;
    plan.cameraSamples = layers.output != LayersOutput::LayerBins && canBeClustered(inputs, options);
    plan.notes = LayersFrame(layers, inputs, options, plan.cameraSamples).notes();
    if (plan.cameraSamples) plan.notes.insert(clusteredNote(inputs));
    return plan;
  });
}

int runsOf(const SequencePlan& plan) {
  const bool tells = !plan.deep && (plan.base ? plan.base->tellsErrors : deep::tellsResponse(plan.denoise));
  return plan.errors && !tells ? 1 + flat::SureParams().probes : 1;
}

FrameSource openFrame(const FrameInputs& inputs, const SourceOptions& options, const SequencePlan& plan) {
  FrameSource source(inputs, options);
  if (source.deep() != plan.deep)
    fail("{}: expected a {} file like the first of the sequence", inputs.main, plan.deep ? "deep" : "flat");
  if (plan.cameraSamples) {
    source.clusterFirst();
    return source;
  }
  wantInputs(plan.denoise, statisticsOf(plan), source);
  return source;
}

deep::DeepImage denoiseAsPlanned(deep::DeepImage image, const FrameInputs& inputs, const SequencePlan& plan,
                                 const deep::BaseGuide* guide, const Progress& progress, deep::DenoiseStats* stats) {
  if (!plan.deep) return denoiseFlat(std::move(image), plan, progress, stats);
  if (!plan.errors) return denoiseDeep(std::move(image), inputs, plan, guide, progress, stats);
  // The first run is a third of the work, two probes are the rest.
  const deep::DeepImage noisy = image.copy();
  const Progress first{[&](double done) { progress.at(done / 3); }, progress.stop};
  image = denoiseDeep(std::move(image), inputs, plan, guide, first, stats);
  const Stopwatch watch;
  const Progress rest{[&](double done) { progress.at((1 + 2 * done) / 3); }, progress.stop};
  deep::addFlattenedErrors(
      noisy, plan.denoise.inputs,
      [&](deep::DeepImage moved, const Progress& part) {
        return denoiseDeep(std::move(moved), inputs, plan, nullptr, part, nullptr);
      },
      {}, rest, image);
  if (stats) stats->seconds["error"] += watch.seconds();
  return image;
}

std::string describePlan(const SequencePlan& plan) {
  if (plan.layers) return fmt::format("{} cluster {}", plan.layers->settings, plan.cameraSamples);
  return fmt::format("{} cluster {} {} guide {} errors {}", describeFilter(plan.denoise), plan.cameraSamples,
                     plan.base ? plan.base->settings : "", plan.guide ? plan.guide->settings : "none", plan.errors);
}

}  // namespace fathom::cli
