// Another frame around the same pixels.
#pragma once

#include "deep/image.h"

namespace fathom::deep {

enum class Placement {
  Stay,    // pixels keep their coordinates
  Corner,  // the old display window's upper left corner lands on the new one's
  Centre   // the middles meet, rounded up and to the left
};

// The image in another display window. The data window moves along, whole; with `crop` only what lies inside of the
// display window stays. Samples pass bit for bit. Halo 0, after the move (see reformatMove).
DeepImage reformat(DeepImage image, const Box& displayWindow, Placement placement, bool crop);

struct Move {
  int x, y;
};
// By how many pixels `reformat` moves an image.
Move reformatMove(const Box& from, const Box& to, Placement placement);

}  // namespace fathom::deep
