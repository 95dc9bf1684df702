// What is looked at, as an image for the screen. No threads of its own: `Renderer` runs it in the background.
#pragma once

#include <QImage>
#include <list>
#include <memory>

#include "gui/colouring.h"
#include "gui/display.h"
#include "gui/picture.h"
#include "gui/seen.h"
#include "gui/view_state.h"

namespace fathom::gui {

struct RenderRequest {
  PicturePtr a, b;  // one may be null
  ViewState state;
  Box box;         // pixels of the image; may reach beyond the data window, where the result is black
  int step = 1;    // every step-th pixel of every step-th row
  int shrink = 1;  // a power of two: so many pixels across that were taken become one of the image, their average
  OverlayPtr overlay = {};  // in A and B where they are deep; null: nothing
  bool operator==(const RenderRequest&) const = default;
};

// What can be shown of the pictures that are there: A alone, B alone, or what was asked for.
Comparison comparisonOf(const RenderRequest& request);

struct Rendered {
  RenderRequest request;
  int step = 1;          // that was taken: the request's, or a multiple for a quick first answer
  int pixelSize = 1;     // how many pixels across of the picture each of an image's is
  QImage a, b;           // null where the comparison does not show that picture; a difference is in `a`
  SeenPtr seenA, seenB;  // what the images were made from
  SeenPtr compared;      // the difference or error that `a` shows, or null
  ValueRange ends;       // of the false colours
};

// The one image that there is, or A and B beside one another; of a wipe B from the picture's column `wipe` on.
QImage joined(const Rendered& rendered, double wipe);

class Compositor {
 public:
  explicit Compositor(std::shared_ptr<const Display> display) : display_(std::move(display)) {}

  // Throws Error, and Cancelled between rows. Planes are kept, so that the next brightness of the same view is only a
  // matter of colours; pictures are not kept.
  Rendered make(const RenderRequest& request, int step, const Progress& progress = {});
  // Seconds that compositing is going to take, as the last times tell; 0 where the planes are there.
  double estimate(const RenderRequest& request, int step) const;

 private:
  struct Kept {
    std::weak_ptr<const Picture> picture;
    deep::DepthRange clip;
    OverlayPtr overlay;
    SeenPtr seen;
  };
  struct KeptRange {
    std::weak_ptr<const Picture> picture;
    std::string layer;
    ValueRange range;
  };

  SeenPtr find(const PicturePtr& picture, const RenderRequest& request, int step) const;
  SeenPtr seen(const PicturePtr& picture, const RenderRequest& request, int step, const Progress& progress);
  ValueRange range(const PicturePtr& picture, const std::string& layer, const Progress& progress);

  std::shared_ptr<const Display> display_;
  std::list<Kept> kept_;  // the newest first
  std::list<KeptRange> ranges_;
  double secondsPerPixel_ = 1e-7;
};

}  // namespace fathom::gui
