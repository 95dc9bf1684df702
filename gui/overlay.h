// A volume in the pictures that are looked at, while it moves: it goes among their samples only where and when they are
// composited.
#pragma once

#include <memory>
#include <string>

#include "deep/image.h"
#include "deep/ops/transform.h"
#include "gui/picture.h"

namespace fathom::gui {

struct Overlay {
  std::shared_ptr<const deep::DeepImage> volume;
  deep::Transform move;  // by whole pixels, and in depth

  // Where it lies.
  Box window() const { return deep::transformedWindow(volume->dataWindow, volume->displayWindow, move); }
};
using OverlayPtr = std::shared_ptr<const Overlay>;

// What is shown in place of the session's pictures as long as this layer is.
struct Draft {
  PicturePtr a, b;  // without the volume; one may be null
  OverlayPtr overlay;
  std::string layer;
};

}  // namespace fathom::gui
