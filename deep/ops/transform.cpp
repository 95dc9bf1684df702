#include "deep/ops/transform.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/channels.h"

namespace fathom::deep {

namespace {

constexpr int kGrain = 1 << 16;  // samples

AxisMap alongAxis(int begin, int end, double scale, double move) {
  if (scale == 1) return {.to = move};
  const double middle = (double(begin) + double(end)) / 2;
  return {.from = middle, .to = middle + move, .den = scale};
}

// Calls body(i) for every sample.
template <class Body>
void forEachSample(const DeepImage& image, const Body& body) {
  const size_t tiles = (image.samples() + kGrain - 1) / kGrain;
  parallelFor(0, int(tiles), [&](int tile) {
    const size_t end = std::min(image.samples(), (size_t(tile) + 1) * kGrain);
    for (size_t i = size_t(tile) * kGrain; i < end; ++i) body(i);
  });
}

void moveDepths(DeepImage& image, double scale, double offset) {
  const std::span<float> z = image.get("Z");
  const std::span<float> zBack = image.find("ZBack") ? image.get("ZBack") : std::span<float>();
  const auto moved = [=](float depth) { return float(double(depth) * scale + offset); };
  forEachSample(image, [&](size_t i) {
    const float front = z[i];
    z[i] = moved(front);
    if (zBack.empty()) return;
    const bool range = zBack[i] > front;
    zBack[i] = moved(zBack[i]);
    if (range && zBack[i] <= z[i]) zBack[i] = std::nextafter(z[i], std::numeric_limits<float>::infinity());
  });
  if (scale == 1 || !image.find("variance.Z")) return;
  const std::span<float> variance = image.get("variance.Z");
  forEachSample(image, [&](size_t i) { variance[i] = float(double(variance[i]) * scale * scale); });
}

}  // namespace

Resampling Transform::resampling(const Box& window) const {
  return {.columns = alongAxis(window.x0, window.x1, scale, x),
          .rows = alongAxis(window.y0, window.y1, scale, y),
          .tolerance = tolerance};
}

bool Transform::movesWholePixels() const {
  const Resampling pixels = resampling({});
  return pixels.columns.isWholeMove() && pixels.rows.isWholeMove();
}

void Transform::check() const {
  for (const double value : {x, y, z})
    if (!std::isfinite(value)) fail("transform: expected finite numbers, found {}", value);
  for (const double value : {scale, zScale})
    if (!(value >= 1e-3 && value <= 1e3)) fail("transform: expected a scale from 0.001 to 1000, found {}", value);
  if (!(tolerance >= 0)) fail("transform: expected a tolerance of at least 0, found {}", tolerance);
}

DeepImage transform(DeepImage image, const Transform& how) {
  how.check();
  if (how.z != 0 || how.zScale != 1) moveDepths(image, how.zScale, how.z);
  const Resampling pixels = how.resampling(image.displayWindow);
  if (!pixels.columns.isWholeMove() || !pixels.rows.isWholeMove()) return resample(std::move(image), pixels);
  image.dataWindow = resampledWindow(image.dataWindow, pixels);
  return image;
}

Box transformedWindow(const Box& dataWindow, const Box& displayWindow, const Transform& how) {
  return resampledWindow(dataWindow, how.resampling(displayWindow));
}

}  // namespace fathom::deep
