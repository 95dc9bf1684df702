// The numbers behind what is shown: a layer of a picture composited over a window of pixels.
#pragma once

#include <QPoint>
#include <QString>
#include <memory>
#include <vector>

#include "base/progress.h"
#include "deep/clip_view.h"
#include "gui/overlay.h"
#include "gui/picture.h"

namespace fathom::gui {

// Rows are dense. Pixel (x, y) of the planes is pixel (box.x0 + x * step, box.y0 + y * step) of the image.
struct Seen {
  Layer layer;  // of the picture
  Box box;
  int step = 1;
  int width = 0, height = 0;
  std::vector<Buffer<float>> values = {};  // by channel without A, premultiplied where the picture's are; counts
  Buffer<float> alpha = {};                // empty where there is none
  Buffer<uint32_t> ids = {};               // in place of values: of the sample that is seen most, 0 where none is
  // 1 where a sample's value is no number and compositing took it for 0; empty where there is none in the picture.
  Buffer<uint8_t> spoiled = {};

  size_t pixels() const { return size_t(width) * size_t(height); }
  // The place of the image's pixel in the planes; with a step, that of the pixel which stands for it. -1: outside.
  ptrdiff_t index(QPoint pixel) const;
};
using SeenPtr = std::shared_ptr<const Seen>;

// A deep picture as `clip` leaves it, with the overlay's volume in it where there is one; a flat one as it is; 0 outside of
// the data window. Throws Error, and Cancelled between rows.
Seen see(const Picture& picture, const std::string& layer, const deep::DepthRange& clip, const Box& box, int step,
         const Progress& progress = {}, const Overlay* overlay = nullptr);

// A pixel's values in words, with the channel's name ("R", "id"), to so many digits; identifiers and counts in full.
struct NamedValue {
  QString name, text;
};
std::vector<NamedValue> namedValues(const Seen& seen, size_t index, int digits = 5);

}  // namespace fathom::gui
