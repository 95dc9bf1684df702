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

void Statistics::add(const DeepImage& image, const Box& box) {
  const std::span<const float> z = image.tryGet("Z"), back = image.tryGet("ZBack");
  pixels += box.area();
  for (int y = box.y0; y < box.y1; ++y)
    for (int x = box.x0; x < box.x1; ++x) {
      const size_t pixel = image.dataWindow.index(x, y);
      const uint64_t count = image.count(pixel);
      samples += count;
      if (count > mostSamples) {
        mostSamples = count;
        mostX = x;
        mostY = y;
      }
      ++histogram[bucketOf(count)];
      if (!z.empty()) addDepths(image.offsets[pixel], image.offsets[pixel + 1], z, back);
    }
}

void Statistics::addDepths(uint64_t begin, uint64_t end, std::span<const float> z, std::span<const float> back) {
  bool sorted = true;
  for (uint64_t i = begin; i < end; ++i) {
    sorted = sorted && (i == begin || z[i - 1] <= z[i]);
    const float last = back.empty() ? z[i] : back[i];
    if (!std::isfinite(z[i]) || !std::isfinite(last)) {
      ++badDepths;
      continue;
    }
    volumes += last > z[i];
    nearest = std::min(nearest, z[i]);
    farthest = std::max({farthest, z[i], last});
  }
  unsortedPixels += !sorted;
}

}  // namespace fathom::deep
