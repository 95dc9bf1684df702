#include "deep/statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace fathom::deep {

namespace {

size_t bucketOf(uint64_t count) {
  if (count < 2) return size_t(count);
  return std::min(size_t(std::bit_width(count - 1)) + 1, Statistics::kBuckets - 1);
}

}  // namespace

std::string Statistics::bucketName(size_t bucket) {
  if (bucket <= 2) return std::to_string(bucket);
  const uint64_t first = (uint64_t(1) << (bucket - 2)) + 1;
  return bucket == kBuckets - 1 ? fmt::format("{}+", first) : fmt::format("{}-{}", first, 2 * (first - 1));
}

void Statistics::add(const DeepImage& band) {
  const std::span<const float> z = band.tryGet("Z"), back = band.tryGet("ZBack");
  pixels += band.pixels();
  samples += band.samples();
  for (size_t pixel = 0; pixel < band.pixels(); ++pixel) {
    const uint64_t count = band.count(pixel);
    if (count > mostSamples) {
      mostSamples = count;
      mostX = band.dataWindow.x0 + int(pixel % size_t(band.dataWindow.width()));
      mostY = band.dataWindow.y0 + int(pixel / size_t(band.dataWindow.width()));
    }
    ++histogram[bucketOf(count)];
    bool sorted = true;
    if (!z.empty())
      for (uint64_t i = band.offsets[pixel] + 1; i < band.offsets[pixel + 1]; ++i) sorted = sorted && z[i - 1] <= z[i];
    unsortedPixels += !sorted;
  }
  for (size_t i = 0; i < z.size(); ++i) {
    const float end = back.empty() ? z[i] : back[i];
    if (!std::isfinite(z[i]) || !std::isfinite(end)) {
      ++badDepths;
      continue;
    }
    volumes += end > z[i];
    nearest = std::min(nearest, z[i]);
    farthest = std::max({farthest, z[i], end});
  }
}

}  // namespace fathom::deep
