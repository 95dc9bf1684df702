// Rows are counted in parallel and put together in their order.
#include "deep/ops/stats.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/pixel_pieces.h"

namespace fathom::deep {

namespace {

void put(ChannelStats& stats, double value) {
  stats.least = stats.finite == 0 ? value : std::min(stats.least, value);
  stats.largest = stats.finite == 0 ? value : std::max(stats.largest, value);
  ++stats.finite;
}

ChannelStats countRow(const Channel& channel, size_t begin, size_t end) {
  ChannelStats stats{channel.name, channel.type};
  for (size_t i = begin; i < end && channel.type == PixelType::Uint; ++i) put(stats, channel.ids[i]);
  for (size_t i = begin; i < end && channel.type != PixelType::Uint; ++i) {
    const float value = channel.values[i];
    stats.nans += std::isnan(value);
    stats.infinities += std::isinf(value);
    if (!std::isfinite(value)) continue;
    stats.negatives += value < 0;
    stats.sum += double(value);
    put(stats, double(value));
  }
  return stats;
}

void append(ChannelStats& all, const ChannelStats& row) {
  all.nans += row.nans;
  all.infinities += row.infinities;
  all.negatives += row.negatives;
  if (row.finite == 0) return;
  all.least = all.finite == 0 ? row.least : std::min(all.least, row.least);
  all.largest = all.finite == 0 ? row.largest : std::max(all.largest, row.largest);
  all.finite += row.finite;
  all.sum += row.sum;
}

void countAlphas(std::span<const float> alphas, ImageStats& stats) {
  for (const float alpha : alphas) {
    stats.clear += alpha == 0;
    stats.opaque += alpha >= 1;
    stats.badAlphas += !(alpha >= 0 && alpha <= 1);
  }
}

void countUntidiness(const DeepImage& image, size_t firstPixel, size_t endPixel, ImageStats& stats) {
  const std::span<const float> z = image.get("Z"), zBack = image.tryGet("ZBack");
  PixelPieces pieces;
  for (size_t pixel = firstPixel; pixel < endPixel; ++pixel) {
    const size_t first = size_t(image.offsets[pixel]), count = image.count(pixel);
    pieces.set(z.subspan(first, count), zBack.empty() ? zBack : zBack.subspan(first, count));
    const Untidiness& found = pieces.untidiness();
    stats.unsorted += found.unsorted;
    stats.pointsCoincide += found.pointsCoincide;
    stats.volumesOverlap += found.volumesOverlap;
    stats.untidy += found.any();
  }
}

ImageStats countPixels(const DeepImage& image, size_t firstPixel, size_t endPixel) {
  ImageStats stats;
  const size_t begin = size_t(image.offsets[firstPixel]), end = size_t(image.offsets[endPixel]);
  for (const Channel& channel : image.channels) stats.channels.push_back(countRow(channel, begin, end));
  if (const auto alpha = image.tryGet("A"); !alpha.empty()) countAlphas(alpha.subspan(begin, end - begin), stats);
  if (!image.tryGet("Z").empty()) countUntidiness(image, firstPixel, endPixel, stats);
  return stats;
}

}  // namespace

void ImageStats::add(const DeepImage& band) {
  if (channels.empty())
    for (const Channel& channel : band.channels) channels.push_back({channel.name, channel.type});
  if (channels.size() != band.channels.size())
    fail("expected {} channels in every band, found {}", channels.size(), band.channels.size());
  samples.add(band);
  bytes += 4 * band.channels.size() * band.samples() + 8 * band.pixels();
  const size_t width = size_t(band.dataWindow.width());
  std::vector<ImageStats> rows(size_t(band.dataWindow.height()));
  parallelFor(0, band.dataWindow.height(),
              [&](int y) { rows[size_t(y)] = countPixels(band, size_t(y) * width, size_t(y + 1) * width); });
  for (const ImageStats& row : rows) {
    for (size_t c = 0; c < channels.size(); ++c) append(channels[c], row.channels[c]);
    clear += row.clear, opaque += row.opaque, badAlphas += row.badAlphas;
    unsorted += row.unsorted, pointsCoincide += row.pointsCoincide, volumesOverlap += row.volumesOverlap;
    untidy += row.untidy;
  }
}

}  // namespace fathom::deep
