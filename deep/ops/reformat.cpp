#include "deep/ops/reformat.h"

#include "deep/ops/crop.h"

namespace fathom::deep {

Move reformatMove(const Box& from, const Box& to, Placement placement) {
  if (placement == Placement::Stay) return {0, 0};
  if (placement == Placement::Corner) return {to.x0 - from.x0, to.y0 - from.y0};
  // Shifting halves negative numbers downwards, too.
  return {to.x0 - from.x0 + ((to.width() - from.width()) >> 1), to.y0 - from.y0 + ((to.height() - from.height()) >> 1)};
}

DeepImage reformat(DeepImage image, const Box& displayWindow, Placement placement, bool crops) {
  const Move move = reformatMove(image.displayWindow, displayWindow, placement);
  image.displayWindow = displayWindow;
  image.dataWindow = moved(image.dataWindow, move.x, move.y);
  return crops ? crop(image, displayWindow) : std::move(image);
}

}  // namespace fathom::deep
