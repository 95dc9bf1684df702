#include "deep/ops/sample.h"

#include "deep/channels.h"
#include "deep/pixel_pieces.h"
#include "flat/error.h"

namespace fathom::deep {

std::vector<SampleLight> lightOf(const DeepImage& image, int x, int y) {
  const Box& window = image.dataWindow;
  if (!window.contains(x, y))
    fail("pixel ({}, {}): expected one of the data window, {} x {} at {} {}", x, y, window.width(), window.height(),
         window.x0, window.y0);
  const size_t pixel = window.index(x, y), first = size_t(image.offsets[pixel]), count = image.count(pixel);
  const std::span<const float> zBack = image.tryGet("ZBack");
  const bool mergePoints = !holdsStatistics(image);
  PixelPieces pieces;
  pieces.set(image.get("Z").subspan(first, count), zBack.empty() ? zBack : zBack.subspan(first, count));
  pieces.checkOverlaps(mergePoints, window, pixel);
  std::vector<SampleLight> light(count);
  std::vector<bool> begun(count);
  double passed = 1;
  pieces.visit(image.get("A").subspan(first, count), mergePoints, [&](const Piece& piece) {
    for (const Share& share : piece.shares) {
      SampleLight& sample = light[share.sample];
      if (!begun[share.sample]) sample.front = passed;
      begun[share.sample] = true;
      sample.seen += passed * piece.alpha * share.part;
    }
    passed *= 1 - piece.alpha;
  });
  return light;
}

}  // namespace fathom::deep
