#include "deep/compare.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/alpha.h"
#include "deep/sample_depths.h"

namespace fathom::deep {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr double kDark = 0.01;  // as in flat/metrics
constexpr std::array<const char*, 3> kColours = {"R", "G", "B"};

void checkSameBins(const DeepImage& image, const DeepImage& reference) {
  const Box &a = image.dataWindow, &r = reference.dataWindow;
  if (a != r)
    fail("expected the data window of the reference, ({}, {}) to ({}, {}), found ({}, {}) to ({}, {})", r.x0, r.y0,
         r.x1 - 1, r.y1 - 1, a.x0, a.y0, a.x1 - 1, a.y1 - 1);
  for (size_t i = 0; i < image.pixels(); ++i)
    if (image.count(i) != reference.count(i))
      fail("pixel ({}, {}): expected the {} bins of the reference, found {}; flattened images can be compared",
           a.x0 + int(i % size_t(a.width())), a.y0 + int(i / size_t(a.width())), reference.count(i), image.count(i));
}

std::array<std::span<const float>, 3> variancesOf(const DeepImage& image) {
  std::array<std::span<const float>, 3> result;
  for (size_t c = 0; c < 3; ++c) result[c] = image.tryGet(std::string("variance.") + kColours[c]);
  const bool all = std::ranges::none_of(result, [](const auto& plane) { return plane.empty(); });
  return all ? result : std::array<std::span<const float>, 3>{};
}

double finiteVariance(float v) {
  return v > 0 ? double(finiteOrZero(v)) : 0;
}

BinMetrics compareBins(const DeepImage& image, const DeepImage& reference, const DeepMetricParams& params) {
  const auto alpha = image.get("A"), referenceAlpha = reference.get("A"), samples = reference.tryGet("samples");
  const auto variances = variancesOf(reference);
  if (params.correct && variances[0].empty())
    fail("channel variance.R: expected in the reference, to correct for its own error, found none");
  std::array<std::span<const float>, 3> colours, referenceColours;
  for (size_t c = 0; c < 3; ++c) colours[c] = image.get(kColours[c]), referenceColours[c] = reference.get(kColours[c]);
  const Buffer<float> weights = effectiveAlpha(reference);

  BinMetrics result;
  double weight = 0, few = 0, relative = 0, squared = 0, ownRelative = 0, own = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    const double w = weights[i], a = opacity(alpha[i]), r = opacity(referenceAlpha[i]);
    if (!(w > 0)) continue;
    if (!samples.empty() && !(samples[i] >= params.minSamples)) {
      few += w;
      continue;
    }
    double binRelative = 0, binSquared = 0, binOwnRelative = 0, binOwn = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double y = double(referenceColours[c][i]) / r, error = double(colours[c][i]) / a - y;
      const double scale = 1 / (y * y + kDark);
      binSquared += error * error;
      binRelative += error * error * scale;
      if (variances[c].empty()) continue;
      binOwnRelative += finiteVariance(variances[c][i]) * scale;
      binOwn += finiteVariance(variances[c][i]);
    }
    if (!std::isfinite(binSquared)) {
      ++result.excluded;
      continue;
    }
    ++result.bins;
    weight += w;
    relative += w * binRelative, squared += w * binSquared;
    ownRelative += w * binOwnRelative, own += w * binOwn;
  }
  if (result.bins == 0) fail("expected bins to compare, found none with alpha, finite colours and enough samples");
  result.relMse = (relative - (params.correct ? ownRelative : 0)) / (3 * weight);
  result.mse = (squared - (params.correct ? own : 0)) / (3 * weight);
  if (!variances[0].empty()) result.ownRelMse = ownRelative / (3 * weight);
  result.leftOut = few / (few + weight);
  return result;
}

// What a sample contributes to its pixel.
struct Contribution {
  size_t sample;
  double factor;  // of its premultiplied values
  double alpha;   // of the pixel
};

// How much of a sample lies in front of a depth; infinity is behind everything.
double fractionBefore(const Range& range, float depth) {
  if (depth == kInfinity) return 1;
  if (range.isPoint()) return range.z < depth ? 1 : 0;
  return std::clamp((double(depth) - range.z) / (double(range.zBack) - range.z), 0.0, 1.0);
}

std::vector<Contribution> contributionsOf(const DeepImage& image, size_t pixel, float near, float far) {
  const auto alpha = image.get("A");
  const SampleDepths depths(image);
  std::vector<Contribution> result;
  double passed = 1;
  for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i) {
    const Range range = depths[i];
    const double a = opacity(alpha[i]), before = fractionBefore(range, near),
                 inside = fractionBefore(range, far) - before;
    if (inside > 0) {
      const Part part = partOf(a, inside);
      const double reaching = passed * (before > 0 ? 1 - partOf(a, before).alpha : 1);
      result.push_back({i, reaching * part.weight, reaching * part.alpha});
    }
    passed *= 1 - a;
  }
  return result;
}

std::optional<flat::Metrics> compareParts(const DeepImage& image, const DeepImage& reference, float near, float far,
                                          bool correct) {
  const flat::Image part = visiblePart(reference, near, far);
  if (std::ranges::none_of(part.get("A").values, [](float a) { return a > 0; })) return {};
  return flat::compare(visiblePart(image, near, far), part, {.correct = correct, .onlyCovered = true});
}

}  // namespace

float medianDepth(const DeepImage& image) {
  const Buffer<float> weights = effectiveAlpha(image);
  const auto z = image.get("Z");
  std::vector<std::pair<float, float>> depths;
  double whole = 0;
  for (size_t i = 0; i < weights.size(); ++i)
    if (weights[i] > 0 && std::isfinite(z[i])) depths.emplace_back(z[i], weights[i]), whole += weights[i];
  if (depths.empty()) fail("expected samples with alpha, to find their median depth, found none");
  std::ranges::sort(depths);
  double sum = 0;
  for (const auto& [depth, weight] : depths)
    if ((sum += weight) >= whole / 2) return depth;
  return depths.back().first;
}

flat::Image visiblePart(const DeepImage& image, float near, float far) {
  flat::Image result{image.dataWindow, image.displayWindow, {}, {}};
  const auto variances = variancesOf(image);
  const auto alpha = image.get("A");
  std::vector<std::span<const float>> sources;
  for (const char* name : kColours) sources.push_back(image.get(name)), result.add(name);
  const size_t a = result.planes.size();
  result.add("A");
  if (!variances[0].empty())
    for (const char* name : kColours) result.add(std::string("variance.") + name);
  const size_t width = size_t(image.dataWindow.width());
  parallelFor(0, image.dataWindow.height(), [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < (size_t(y) + 1) * width; ++pixel) {
      const std::vector<Contribution> contributions = contributionsOf(image, pixel, near, far);
      double covered = 0;
      for (const Contribution& k : contributions) covered += k.alpha;
      result.planes[a].values[pixel] = float(covered);
      for (size_t c = 0; c < 3; ++c) {
        double sum = 0, variance = 0;
        for (const Contribution& k : contributions) {
          sum += k.factor * double(sources[c][k.sample]);
          if (variances[c].empty()) continue;
          const double share = k.factor * opacity(alpha[k.sample]);
          variance += share * share * finiteVariance(variances[c][k.sample]);
        }
        result.planes[c].values[pixel] = float(sum);
        if (!variances[c].empty()) result.planes[a + 1 + c].values[pixel] = float(variance);
      }
    }
  });
  return result;
}

void addOwnVariance(const DeepImage& noisy, DeepImage& reference) {
  checkSameBins(noisy, reference);
  const auto counts = noisy.get("samples"), referenceCounts = std::as_const(reference).get("samples");
  Buffer<float> ratio(reference.samples());
  for (size_t i = 0; i < ratio.size(); ++i) ratio[i] = referenceCounts[i] > 0 ? counts[i] / referenceCounts[i] : 0;
  for (const char* colour : kColours) {
    const std::string name = std::string("variance.") + colour;
    const auto variance = noisy.get(name);
    Buffer<float>& own = reference.add(name, PixelType::Float).values;
    for (size_t i = 0; i < own.size(); ++i) own[i] = float(finiteVariance(variance[i]) * double(ratio[i]));
  }
}

DeepMetrics compare(const DeepImage& image, const DeepImage& reference, const DeepMetricParams& params) {
  checkSameBins(image, reference);
  DeepMetrics result;
  result.bins = compareBins(image, reference, params);
  for (const float depth : params.clips)
    result.clips.push_back({depth, compareParts(image, reference, -kInfinity, depth, params.correct),
                            compareParts(image, reference, depth, kInfinity, params.correct)});
  result.flattened = flat::compare(visiblePart(image), visiblePart(reference), {.correct = params.correct});
  return result;
}

}  // namespace fathom::deep
