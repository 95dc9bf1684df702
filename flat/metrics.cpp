#include "flat/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/ssim.h"
#include "flat/tonemap.h"

namespace fathom::flat {

namespace {

constexpr double kDark = 0.01;  // what keeps relative errors of black pixels finite
constexpr std::array<const char*, 3> kColours = {"R", "G", "B"};

double square(double x) {
  return x * x;
}

std::string describe(const Box& box) {
  return fmt::format("({}, {}) to ({}, {})", box.x0, box.y0, box.x1 - 1, box.y1 - 1);
}

// The planes to compare, and which pixels take part.
struct Pair {
  int width = 0, height = 0;
  std::array<const float*, 3> image = {}, reference = {};
  std::array<const float*, 3> variance = {};  // null where the reference has none
  std::vector<uint8_t> used = {};
  size_t pixels = 0, excluded = 0;

  bool finite(size_t i) const {
    for (size_t c = 0; c < 3; ++c)
      if (!isFinite(image[c][i]) || !isFinite(reference[c][i])) return false;
    return true;
  }
};

Pair makePair(const Image& image, const Image& reference, const MetricParams& params) {
  if (image.dataWindow != reference.dataWindow)
    fail("expected the data window of the reference, {}, found {}", describe(reference.dataWindow),
         describe(image.dataWindow));
  Pair pair{.width = image.dataWindow.width(), .height = image.dataWindow.height()};
  for (size_t c = 0; c < 3; ++c) {
    pair.image[c] = image.get(kColours[c]).values.data();
    pair.reference[c] = reference.get(kColours[c]).values.data();
    const Plane* variance = reference.find(std::string("variance.") + kColours[c]);
    if (variance) pair.variance[c] = variance->values.data();
  }
  if (!pair.variance[0] || !pair.variance[1] || !pair.variance[2]) pair.variance = {};
  if (params.correct && !pair.variance[0])
    fail("channel variance.R: expected in the reference, to correct for its own error, found none");
  const float* covered = params.onlyCovered ? reference.get("A").values.data() : nullptr;
  pair.used.resize(image.dataWindow.area());
  for (size_t i = 0; i < pair.used.size(); ++i) {
    if (covered && !(covered[i] > 0)) continue;
    pair.used[i] = pair.finite(i);
    ++(pair.used[i] ? pair.pixels : pair.excluded);
  }
  if (pair.pixels == 0) fail("expected pixels to compare, found none that are finite on both sides");
  return pair;
}

// Sums over channels and pixels.
struct Sums {
  double relative = 0, squared = 0, mapped = 0, symmetric = 0, ownRelative = 0, own = 0;

  Sums& operator+=(const Sums& s) {
    relative += s.relative, squared += s.squared, mapped += s.mapped, symmetric += s.symmetric;
    ownRelative += s.ownRelative, own += s.own;
    return *this;
  }
};

double ownVariance(const Pair& pair, size_t c, size_t i) {
  const float v = pair.variance[c] ? pair.variance[c][i] : 0;
  return v > 0 && v <= kLargest ? v : 0;
}

Sums pixelSums(const Pair& pair, size_t i) {
  Sums sums;
  for (size_t c = 0; c < 3; ++c) {
    const double a = pair.image[c][i], r = pair.reference[c][i], v = ownVariance(pair, c, i);
    const double scale = 1 / (r * r + kDark);
    sums += {square(a - r) * scale,
             square(a - r),
             square(toneMap(a) - toneMap(r)),
             std::abs(a - r) / (std::abs(a) + std::abs(r) + kDark),
             v * scale,
             v};
  }
  return sums;
}

// The relative squared error of a pixel, summed over channels, less the reference's own if that is to be taken off.
double pixelRelative(const Pair& pair, size_t i, bool correct) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double r = pair.reference[c][i], own = correct ? ownVariance(pair, c, i) : 0;
    sum += (square(pair.image[c][i] - r) - own) / (square(r) + kDark);
  }
  return sum;
}

// Row sums in parallel, added in row order.
template <class Sum, class AtPixel>
Sum sumPixels(const Pair& pair, const std::vector<uint8_t>& used, const AtPixel& atPixel) {
  std::vector<Sum> rows(size_t(pair.height), Sum{});
  parallelFor(0, pair.height, [&](int y) {
    const size_t first = size_t(y) * size_t(pair.width);
    for (size_t i = first; i < first + size_t(pair.width); ++i)
      if (used[i]) rows[size_t(y)] += atPixel(i);
  });
  Sum sum{};
  for (const Sum& row : rows) sum += row;
  return sum;
}

// The used pixels without the worst share of them; of equal ones the first go.
std::vector<uint8_t> withoutWorst(const Pair& pair, double share) {
  std::vector<std::pair<double, size_t>> order;
  for (size_t i = 0; i < pair.used.size(); ++i)
    if (pair.used[i]) order.emplace_back(-pixelRelative(pair, i, false), i);
  const size_t worst = size_t(share * double(order.size()));
  std::nth_element(order.begin(), order.begin() + long(worst), order.end());
  std::vector<uint8_t> used = pair.used;
  for (size_t k = 0; k < worst; ++k) used[order[k].second] = 0;
  return used;
}

std::vector<float> mappedLuminance(const std::array<const float*, 3>& planes, const std::vector<uint8_t>& used) {
  std::vector<float> result(used.size(), 0);
  for (size_t i = 0; i < used.size(); ++i)
    if (used[i])
      result[i] =
          float(0.2126 * toneMap(planes[0][i]) + 0.7152 * toneMap(planes[1][i]) + 0.0722 * toneMap(planes[2][i]));
  return result;
}

}  // namespace

Metrics compare(const Image& image, const Image& reference, const MetricParams& params) {
  const Pair pair = makePair(image, reference, params);
  const double values = 3 * double(pair.pixels);
  const Sums sums = sumPixels<Sums>(pair, pair.used, [&](size_t i) { return pixelSums(pair, i); });

  const std::vector<uint8_t> kept = withoutWorst(pair, params.trimmed);
  const size_t keptPixels = size_t(std::count(kept.begin(), kept.end(), 1));
  const double keptRelative =
      sumPixels<double>(pair, kept, [&](size_t i) { return pixelRelative(pair, i, params.correct); });

  Metrics result;
  const double correction = params.correct ? 1 : 0;
  result.relMse = (sums.relative - correction * sums.ownRelative) / values;
  result.relMseTrimmed = keptRelative / (3 * double(keptPixels));
  result.mse = (sums.squared - correction * sums.own) / values;
  result.psnr = sums.mapped > 0 ? -10 * std::log10(sums.mapped / values) : std::numeric_limits<double>::infinity();
  result.smape = sums.symmetric / values;
  result.ssim = ssim(mappedLuminance(pair.image, pair.used), mappedLuminance(pair.reference, pair.used), pair.used,
                     pair.width, pair.height);
  if (pair.variance[0]) result.ownRelMse = sums.ownRelative / values, result.ownMse = sums.own / values;
  result.pixels = pair.pixels;
  result.excluded = pair.excluded;
  return result;
}

Plane relativeError(const Image& image, const Image& reference) {
  const Pair pair = makePair(image, reference, {});
  Plane result{"error", Buffer<float>(pair.used.size(), std::numeric_limits<float>::quiet_NaN())};
  for (size_t i = 0; i < pair.used.size(); ++i)
    if (pair.used[i]) result.values[i] = float(std::sqrt(pixelRelative(pair, i, false) / 3));
  return result;
}

double flicker(const Image& image0, const Image& reference0, const Image& image1, const Image& reference1,
               const MetricParams& params) {
  const Pair before = makePair(image0, reference0, params), after = makePair(image1, reference1, params);
  if (reference0.dataWindow != reference1.dataWindow)
    fail("expected the data window of the frame before, {}, found {}", describe(reference0.dataWindow),
         describe(reference1.dataWindow));
  std::vector<uint8_t> used = after.used;
  for (size_t i = 0; i < used.size(); ++i) used[i] = used[i] && before.used[i];
  const size_t pixels = size_t(std::count(used.begin(), used.end(), 1));
  if (pixels == 0) fail("expected pixels to compare, found none that are finite in both frames");
  const double sum = sumPixels<double>(after, used, [&](size_t i) {
    double changes = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double e0 = double(before.image[c][i]) - before.reference[c][i];
      const double e1 = double(after.image[c][i]) - after.reference[c][i];
      const double own = params.correct ? ownVariance(before, c, i) + ownVariance(after, c, i) : 0;
      changes += (square(e1 - e0) - own) / (square(after.reference[c][i]) + kDark);
    }
    return changes;
  });
  return sum / (3 * double(pixels));
}

}  // namespace fathom::flat
