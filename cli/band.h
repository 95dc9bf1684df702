// Some rows of a frame.
#pragma once

namespace fathom::cli {

struct Band {
  int y0, y1;
};

}  // namespace fathom::cli
