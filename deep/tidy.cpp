// Geometry first: how many pieces each pixel becomes. Then the pieces are made again, and each channel is written from
// the shares.
#include "deep/tidy.h"

#include <algorithm>
#include <atomic>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/channels.h"
#include "deep/sample_depths.h"
#include "flat/limited.h"

namespace fathom::deep {

namespace {

// Calls body(pieces, pixel) for every pixel, its depths loaded, rows in parallel.
template <class Body>
void forEachPixel(const DeepImage& image, const Body& body) {
  const SampleDepths depths(image);
  const size_t width = size_t(image.dataWindow.width());
  parallelFor(0, image.dataWindow.height(), [&](int y) {
    PixelPieces pieces;
    for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel) {
      const size_t first = image.offsets[pixel], count = image.count(pixel);
      pieces.set(depths.fronts(first, count), depths.backs(first, count));
      body(pieces, pixel);
    }
  });
}

template <class T>
Buffer<T> permuted(const Buffer<T>& values, const Buffer<uint64_t>& from) {
  Buffer<T> result(values.size());
  for (size_t i = 0; i < values.size(); ++i) result[i] = values[from[i]];
  return result;
}

// The new offsets; counts stand at their pixel's place plus one.
void accumulate(Buffer<uint64_t>& offsets) {
  for (size_t i = 1; i < offsets.size(); ++i) offsets[i] += offsets[i - 1];
}

float valueOf(const Piece& piece, Role role, std::span<const float> values) {
  double sum = 0;
  for (const Share& share : piece.shares)
    sum += (role == Role::Plain ? share.part : share.weight) * double(finiteOrZero(values[share.sample]));
  return limited(sum);
}

// Writes one piece into sample `to` of `out`; `first` is the pixel's first sample in `image`.
void write(const Piece& piece, const DeepImage& image, size_t first, DeepImage& out, size_t to) {
  const size_t source = first + piece.largest;
  for (size_t c = 0; c < image.channels.size(); ++c) {
    const Channel& from = image.channels[c];
    Channel& channel = out.channels[c];
    const Role role = roleOf(from);
    if (role == Role::Identifier)
      channel.ids[to] = from.ids[source];
    else if (role == Role::Depth)
      channel.values[to] = from.name == "Z" ? piece.range.z : piece.range.zBack;
    else if (piece.whole)
      channel.values[to] = from.values[source];
    else if (role == Role::Alpha)
      channel.values[to] = float(piece.alpha);
    else
      channel.values[to] = valueOf(piece, role, std::span<const float>(from.values).subspan(first));
  }
}

}  // namespace

Untidiness findUntidiness(const DeepImage& image) {
  std::vector<Untidiness> rows(size_t(image.dataWindow.height()));
  forEachPixel(image, [&](const PixelPieces& pieces, size_t pixel) {
    rows[pixel / size_t(image.dataWindow.width())] |= pieces.untidiness();
  });
  Untidiness result;
  for (const Untidiness& row : rows) result |= row;
  return result;
}

DeepImage sortSamples(DeepImage image) {
  Buffer<uint64_t> from(image.samples());
  std::atomic<bool> sorted = true;
  forEachPixel(image, [&](const PixelPieces& pieces, size_t pixel) {
    const size_t first = image.offsets[pixel];
    for (size_t i = 0; i < pieces.order().size(); ++i) from[first + i] = first + pieces.order()[i];
    if (pieces.untidiness().unsorted) sorted = false;
  });
  if (sorted) return image;
  parallelFor(0, int(image.channels.size()), [&](int c) {
    Channel& channel = image.channels[size_t(c)];
    if (channel.type == PixelType::Uint)
      channel.ids = permuted(channel.ids, from);
    else
      channel.values = permuted(channel.values, from);
  });
  return image;
}

std::vector<std::string> dropSampleStatistics(DeepImage& image) {
  std::vector<std::string> dropped;
  for (const Channel& channel : image.channels)
    if (describesSamples(roleOf(channel))) dropped.push_back(channel.name);
  for (const std::string& name : dropped) image.erase(name);
  return dropped;
}

TidyResult tidy(DeepImage image) {
  Untidiness untidiness = findUntidiness(image);
  TidyResult result;
  if (untidiness.volumesOverlap) result.dropped = dropSampleStatistics(image);
  const bool mergePoints = !holdsStatistics(image);
  untidiness.pointsCoincide &= mergePoints;
  if (!untidiness.any()) return {std::move(image), {}};
  const std::span<const float> alpha = image.get("A");
  DeepImage& out = result.image;
  out = {image.dataWindow, image.displayWindow, Buffer<uint64_t>(image.offsets.size(), 0), {}, image.attributes};
  out.attributes.erase("deepImageState");
  forEachPixel(image, [&](PixelPieces& pieces, size_t pixel) {
    const PixelPieces::Size size = pieces.size(mergePoints);
    checkOverlaps(size, image.dataWindow, pixel);
    out.offsets[pixel + 1] = size.pieces;
  });
  accumulate(out.offsets);
  for (const Channel& channel : image.channels) out.add(channel.name, channel.type);
  forEachPixel(image, [&](PixelPieces& pieces, size_t pixel) {
    const size_t first = image.offsets[pixel];
    size_t to = out.offsets[pixel];
    pieces.visit(alpha.subspan(first, image.count(pixel)), mergePoints,
                 [&](const Piece& piece) { write(piece, image, first, out, to++); });
  });
  return result;
}

}  // namespace fathom::deep
