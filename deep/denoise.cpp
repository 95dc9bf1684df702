#include "deep/denoise.h"

#include <chrono>
#include <cmath>
#include <mutex>

#include "deep/denoise_data.h"
#include "deep/feature_prefilter.h"
#include "deep/flatten.h"
#include "deep/gate.h"
#include "deep/guide.h"
#include "deep/joint_filter.h"
#include "deep/selection.h"
#include "deep/still.h"
#include "flat/parallel.h"

namespace fathom::deep {

namespace {

constexpr std::array<const char*, 3> kRgb{"R", "G", "B"};

// Writes the seconds since the last lap under a stage's name.
class Clock {
 public:
  explicit Clock(DenoiseStats& stats) : stats_(stats) {}
  void lap(const char* stage) {
    const auto now = std::chrono::steady_clock::now();
    stats_.seconds[stage] += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  DenoiseStats& stats_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// The filter bank. The paper has (k_O, k_f) = (0.45, 0.7), (0.6, 2), (1e4, 2) and patches of 3x3: on the shared renders
// patches of 7x7 have a quarter less error, and a third candidate as careful about features as the first 8 % less, 15 %
// per bin.
JointFilterParams filterBank(const DenoisePlan& plan) {
  JointFilterParams params;
  params.kColour = {0.45f, 0.7f};
  params.kFeature = {0.7f, 2.0f, 0.7f};
  params.crossed = plan.inputs.halves;
  params.epsilon *= 4 * plan.level * plan.level;
  if (plan.params.quality == Quality::Fast) {
    params.patchRadius = 1;
    params.candidates = 2;
    params.colourCandidates = 1;
    params.kColour = {0.6f, 0.6f};
    params.kFeature = {1.0f, 0.7f, 0.7f};
  }
  return params;
}

// `best`: the noisy halves filtered once more, with colour weights from the first pass's halves (ours; the idea of a
// pilot estimate is as old as NL-Means). A tenth less error, 6 % less per bin. It needs halves: the variance of the
// pilot is their difference.
bool hasSecondPass(const DenoisePlan& plan) {
  return plan.params.quality == Quality::Best && plan.inputs.halves;
}

JointFilterParams secondBank(const DenoisePlan& plan) {
  JointFilterParams params;
  params.epsilon *= 4 * plan.level * plan.level;
  params.radius = 6;
  params.patchRadius = 2;
  params.kColour = {1.0f, 2.0f};
  params.kFeature = {0.7f, 2.0f, 0.7f};
  params.tau = 0.0007f;
  return params;
}

int guideBorder(const JointFilterParams& params) {
  return params.radius + params.patchRadius;
}

// Sums what tiles did, from several threads, and tells how far they are.
class TileCount {
 public:
  TileCount(const DenoiseData& data, const Progress& progress, double from, double to)
      : pixels_(double(data.width) * double(data.height)),
        components_(data.components.size()),
        progress_(progress),
        from_(from),
        to_(to) {}

  void add(const FilterTile& tile) {
    const std::lock_guard lock(mutex_);
    ++tiles_;
    if (tile.active == 0)
      ++skipped_;
    else
      dark_ += components_ - size_t(tile.components);
    done_ += double(tile.box.area());
    progress_.at(from_ + (to_ - from_) * std::min(1.0, done_ / pixels_));
  }
  void tell(DenoiseStats& stats) const {
    stats.counts["tiles"] += tiles_;
    stats.counts["tiles skipped: nothing noisy"] += skipped_;
    stats.counts["tiles where a component has no light"] += dark_;
  }

 private:
  double pixels_;
  size_t components_;
  const Progress& progress_;
  double from_, to_, done_ = 0;
  std::mutex mutex_;
  uint64_t tiles_ = 0, skipped_ = 0, dark_ = 0;
};

// The features of a frame as the joint filter takes them; owns their gradients.
struct FeatureInput {
  std::vector<Buffer<float>> gradients;
  std::vector<FeatureChannel> channels;

  explicit FeatureInput(const DenoiseData& data) {
    for (const Feature* feature : {&data.albedo, &data.normal, &data.depth}) {
      std::vector<Buffer<float>> gradient = squaredGradients(data, *feature);
      for (size_t c = 0; c < gradient.size(); ++c) {
        channels.push_back({feature->value[c].data(), feature->variance[c].data(), gradient[c].data()});
        gradients.push_back(std::move(gradient[c]));
      }
    }
  }
};

// Sections 4.1 and 4.2: one bank of candidates for every component, blended; with pilots where pilotPad > 0.
std::vector<Blend> filterComponents(const DenoiseData& data, const FeatureInput& features,
                                    std::span<const ComponentGuide> guides, const Activity& activity,
                                    const JointFilterParams& params, float level, int pilotPad, TileCount& count) {
  JointFilterInput input{data.width, data.height, data.rowPhase, data.offsets, features.channels, {}};
  std::vector<Candidates> candidates;
  for (size_t c = 0; c < data.components.size(); ++c) {
    const ComponentGuide& guide = guides[c];
    input.components.push_back(
        {data.components[c].data.data(), {&guide.value[0], &guide.value[1]}, {&guide.variance, &guide.variance}});
    candidates.emplace_back(data, params.candidates, pilotPad > 0);
  }
  const auto active = [&](const Box& tile) { return activeComponents(data, activity, tile, params.radius); };
  const auto consume = [&](const FilterTile& tile) {
    int c = 0;
    for (size_t i = 0; i < data.components.size(); ++i)
      if (tile.active >> i & 1)
        addCandidates(data, data.components[i], guides[i].variance, tile, c++, activity.still, candidates[i]);
    count.add(tile);
  };
  jointFilter(input, params, active, consume);
  std::vector<Blend> result;
  for (Candidates& candidate : candidates)
    result.push_back(blendCandidates(data, std::move(candidate), level, pilotPad));
  return result;
}

// The variance of one camera sample, from what the flattened guides tell of their pixels: sum of w^2 / n times it is
// the pixel's. Per component and channel; nothing where halves or the file tell it by bin.
std::vector<std::array<Buffer<float>, 3>> pixelVariance(const DenoiseData& data, std::span<const ComponentGuide> guides,
                                                        const DenoiseInputs& inputs) {
  std::vector<std::array<Buffer<float>, 3>> result;
  if (inputs.halves || inputs.variance) return result;
  const size_t width = size_t(data.width);
  for (const ComponentGuide& guide : guides) {
    auto& planes = result.emplace_back();
    for (Buffer<float>& plane : planes) plane = Buffer<float>(width * size_t(data.height));
    parallelFor(0, data.height, [&](int y) {
      for (size_t x = 0; x < width; ++x) {
        const size_t pixel = size_t(y) * width + x;
        float scale = 0;
        for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b)
          if (data.count[b] > 0) scale += data.weight[b] * data.weight[b] / data.count[b];
        for (size_t c = 0; c < 3; ++c)
          planes[c][pixel] = scale > 0 ? std::min(guide.variance.value[c].row(y)[x] / scale, kLargest) : 0;
      }
    });
  }
  return result;
}

// The same of a bin: from the file, else from the halves, else the pixel's.
float sampleVariance(const DenoiseData& data, const std::array<std::span<const float>, 3>& variance,
                     std::span<const std::array<Buffer<float>, 3>> ofPixels, size_t pixel, size_t bin, size_t c) {
  if (!variance[c].empty())
    return variance[c][bin] > 0 && variance[c][bin] <= kLargest ? variance[c][bin] * data.count[bin] : 0;
  float sum = 0;
  for (size_t i = 0; i < data.components.size(); ++i) {
    const float* v = data.components[i].data.data() + 8 * bin;
    const float scale = data.components[i].perAlbedo ? data.albedo.value[c][bin] + kAlbedoOffset : 1;
    if (!ofPixels.empty()) sum += scale * scale * ofPixels[i][c][pixel];
    if (!(v[3] > 0) || !(v[7] > 0)) continue;
    const float e = scale * (v[c] / v[3] - v[4 + c] / v[7]);
    const float share = v[3] / (v[3] + v[7]);
    sum += share * (1 - share) * e * e * data.count[bin];
  }
  return sum;
}

// Section 5.2 backwards: albedo multiplied back, components added. Fills what the gate needs, with the noisy colour
// from the image.
void compose(const DeepImage& image, const DenoiseData& data, const DenoiseInputs& inputs, const Buffer<uint8_t>& still,
             std::span<const std::array<Buffer<float>, 3>> ofPixels, std::vector<Blend>& filtered,
             Buffer<GateBin>& bins) {
  const std::span<const float> alpha = image.get("A");
  const std::array<std::span<const float>, 3> noisy{image.get("R"), image.get("G"), image.get("B")};
  std::array<std::span<const float>, 3> variance;
  if (inputs.variance) variance = {image.get("variance.R"), image.get("variance.G"), image.get("variance.B")};
  const size_t width = size_t(data.width);
  parallelFor(0, data.height, [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel) {
      for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
        GateBin& bin = bins[b] = {};
        const float inverse = alpha[b] > 0 ? 1 / std::min(alpha[b], 1.0f) : 0;
        bool finite = true;
        for (size_t c = 0; c < 3; ++c) {
          float sum = 0;
          for (size_t i = 0; i < data.components.size(); ++i) {
            float& v = filtered[i].value[3 * b + c];
            if (data.components[i].perAlbedo) v *= data.albedo.value[c][b] + kAlbedoOffset;
            sum += v;
          }
          const float y0 = noisy[c][b] * inverse;
          finite = finite && std::fabs(y0) <= kLargest;
          bin.filtered[c] = still[pixel] ? y0 : sum;
          bin.residual[c] = y0 - bin.filtered[c];
          bin.variance[c] = sampleVariance(data, variance, ofPixels, pixel, b, c);
        }
        bin.samples = data.weight[b] > 0 && finite ? data.count[b] : 0;
        if (!finite) std::fill_n(bin.residual, 3, 0.0f);
      }
    }
  });
}

// The result, premultiplied again: f + k (y - f), by component and whole. Still pixels stay as they are, and bins
// without a weight, which nothing could fill: what is not finite there becomes 0.
void writeColours(DeepImage& image, const DenoiseData& data, const Buffer<uint8_t>& still,
                  std::span<const Blend> filtered, const Buffer<float>& gate) {
  const std::span<const float> alpha = image.get("A");
  const size_t width = size_t(data.width);
  for (size_t c = 0; c < 3; ++c) {
    const std::span<float> whole = image.get(kRgb[c]);
    std::vector<std::span<float>> part;
    for (const DenoiseComponent& component : data.components)
      part.push_back(component.name.empty() ? whole : image.get(component.name + "." + kRgb[c]));
    parallelFor(0, data.height, [&](int y) {
      for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel) {
        for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
          if (!(data.weight[b] > 0)) {
            for (std::span<float>& values : part)
              if (!(std::fabs(values[b]) <= kLargest)) values[b] = 0;
            if (!(std::fabs(whole[b]) <= kLargest)) whole[b] = 0;
            continue;
          }
          if (still[pixel]) continue;
          float sum = 0;
          for (size_t i = 0; i < part.size(); ++i) {
            const float f = filtered[i].value[3 * b + c] * std::min(alpha[b], 1.0f);
            float& value = part[i][b];
            value = gate[b] > 0 && std::fabs(value) <= kLargest ? f + gate[b] * (value - f) : f;
            sum += value;
          }
          whole[b] = sum;
        }
      }
    });
  }
}

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

}  // namespace

DeepImage denoise(DeepImage image, const DenoisePlan& plan, const Progress& progress, DenoiseStats* statsOut) {
  DenoiseStats unwanted;
  DenoiseStats& stats = statsOut ? *statsOut : unwanted;
  Clock clock(stats);
  progress.at(0);
  DenoiseData data = prepareDenoise(image, plan.inputs);
  dropStatistics(image, plan.params, false);
  clock.lap("prepare");
  prefilterFeatures(data);
  clock.lap("prefilter");
  progress.at(0.1);

  const JointFilterParams bank = filterBank(plan), second = secondBank(plan);
  const bool twice = hasSecondPass(plan);
  std::vector<ComponentGuide> guides;
  for (const DenoiseComponent& component : data.components)
    guides.push_back(colourGuide(data, component, guideBorder(bank)));
  const Activity activity =
      findActivity(data, guides, image, plan.inputs, twice ? second.radius : bank.radius, plan.level);
  const FeatureInput features(data);
  countPixels(data, activity, stats);
  clock.lap("guides");
  progress.at(0.15);

  const std::vector<std::array<Buffer<float>, 3>> ofPixels = pixelVariance(data, guides, plan.inputs);
  TileCount count(data, progress, 0.15, twice ? 0.35 : 0.85);
  std::vector<Blend> blends =
      filterComponents(data, features, guides, activity, bank, plan.level, twice ? guideBorder(second) : 0, count);
  count.tell(stats);
  clock.lap("filter");
  if (twice) {
    for (size_t c = 0; c < guides.size(); ++c) guides[c] = std::move(blends[c].pilot);
    blends.clear();
    TileCount again(data, progress, 0.35, 0.85);
    blends = filterComponents(data, features, guides, activity, second, plan.level, 0, again);
    clock.lap("filter again");
  }
  guides.clear();
  progress.at(0.85);
  Buffer<GateBin> bins(data.bins());
  compose(image, data, plan.inputs, activity.still, ofPixels, blends, bins);
  clock.lap("compose");
  const Buffer<float> k =
      plan.params.gate ? gate(data, bins, activity.still, plan.level) : Buffer<float>(data.bins(), 0.0f);
  clock.lap("gate");
  writeColours(image, data, activity.still, blends, k);
  dropStatistics(image, plan.params, true);
  clock.lap("compose");
  progress.at(1);
  return image;
}

float meanLevel(const DeepImage& image) {
  const flat::Image flattened = flatten(image);
  const flat::Plane& alpha = flattened.get("A");
  double sum = 0;
  size_t count = 0;
  for (const char* name : kRgb) {
    const flat::Plane& plane = flattened.get(name);
    for (size_t i = 0; i < plane.values.size(); ++i) {
      if (!(alpha.values[i] > 0) || !(std::fabs(plane.values[i]) <= kLargest)) continue;
      sum += double(plane.values[i]);
      ++count;
    }
  }
  const double mean = count ? sum / double(count) : 0;
  return mean > 1e-20 && mean < double(kLargest) ? float(mean) : 0.5f;
}

int denoiseHalo(const DenoisePlan& plan) {
  // Backwards from a row: the gate's window, the blend's, the error's and the bank's. The farthest bins there need
  // prefiltered features (window, patch, and a row for the gradient), the farthest pixels patches of guides. Those are
  // pooled (2) and may be estimated over 3 rows; or they are a first pass's result, with all that this needs.
  const int prefilter = kPrefilterRadius + kPrefilterPatchRadius + 1;
  const auto pass = [&](const JointFilterParams& bank, int guide) {
    return kBlendRadius + kErrorRadius + bank.radius + std::max(prefilter, bank.patchRadius + 2 + guide);
  };
  const int first = pass(filterBank(plan), 3);
  return kGateRadius + 1 + (hasSecondPass(plan) ? pass(secondBank(plan), first) : first);
}

}  // namespace fathom::deep
