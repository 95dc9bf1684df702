#include "deep/clip.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "deep/channels.h"
#include "deep/ops/sample_plan.h"
#include "deep/sample_depths.h"
#include "deep/tidy.h"

namespace fathom::deep {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Planes {
  float near, far;

  bool has(float z) const { return z >= near && (z < far || (far == kInfinity && near < far)); }
  Range within(const Range& range) const { return {std::max(range.z, near), std::min(range.zBack, far)}; }
};

struct Samples {
  std::span<const float> alpha;
  SampleDepths depths;
};

// Adds what of a sample lies between the planes.
void plan(const Samples& samples, size_t i, const Planes& planes, RowPlan& row) {
  const Range range = samples.depths[i];
  if (range.isPoint()) {
    if (planes.has(range.z)) row.keep(i);
    return;
  }
  const Range inside = planes.within(range);
  if (!(inside.z < inside.zBack)) return;
  if (inside == range) {
    row.keep(i);
    return;
  }
  const double fraction = (double(inside.zBack) - inside.z) / (double(range.zBack) - range.z);
  const Part part = partOf(opacity(samples.alpha[i]), fraction);
  row.change(i, inside.z, inside.zBack, float(part.alpha), float(part.weight));
}

// Clips with planesOf(x, y) at each pixel.
template <class PlanesOf>
DeepImage clipWith(const DeepImage& image, const PlanesOf& planesOf) {
  const Samples samples{image.get("A"), SampleDepths(image)};
  return mapRows(image, [&](int y, RowPlan& row) {
    for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x) {
      const size_t pixel = image.dataWindow.index(x, y);
      const Planes planes = planesOf(x, y);
      row.nextPixel();
      for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i) plan(samples, i, planes, row);
    }
  });
}

}  // namespace

DeepImage clip(const DeepImage& image, float near, float far) {
  DeepImage result = clipWith(image, [&](int, int) { return Planes{near, far}; });
  if (holdsStatistics(image) && clipCuts(image, near, far)) dropSampleStatistics(result);
  return result;
}

bool clipCuts(const DeepImage& image, float near, float far) {
  if (!image.find("ZBack")) return false;
  const SampleDepths depths(image);
  for (size_t i = 0; i < image.samples(); ++i) {
    const Range range = depths[i], inside = Planes{near, far}.within(range);
    if (!range.isPoint() && inside.z < inside.zBack && !(inside == range)) return true;
  }
  return false;
}

DeepImage clipByMap(const DeepImage& image, const flat::Image& map, std::string_view channel, Side keep) {
  const Buffer<float>& depth = map.get(channel).values;
  DeepImage result = clipWith(image, [&](int x, int y) {
    const float z = map.dataWindow.contains(x, y) ? depth[map.dataWindow.index(x, y)] : std::nanf("");
    if (std::isnan(z)) return Planes{-kInfinity, kInfinity};
    return keep == Side::Front ? Planes{-kInfinity, z} : Planes{z, kInfinity};
  });
  if (image.find("ZBack")) dropSampleStatistics(result);
  return result;
}

}  // namespace fathom::deep
