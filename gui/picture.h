// A frame as the viewer holds it: a deep or flat image that does not change any more, and the layers to choose from.
#pragma once

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "base/progress.h"
#include "deep/image.h"
#include "flat/image.h"

namespace fathom::gui {

// Channels that are looked at together.
struct Layer {
  enum class Kind {
    Colour,      // light or a surface's colour: three channels and perhaps A, or grey; through the display transform
    Vector,      // three channels that are directions or positions: shown as v/2 + 1/2
    Depth,       // false colour, all others here too
    Scalar,      // any other single channel
    Variance,    // one to three channels; their mean's root is shown
    Count,       // samples of each pixel of a deep image; no channel
    Identifier,  // a UINT channel: each value has a colour of its own
  };
  std::string name;                   // "RGBA", "diffuse", "N", "Z", "samples per pixel"
  std::vector<std::string> channels;  // in the order R G B A, X Y Z; grey: Y
  Kind kind;
  bool nonFinite = false;  // whether one of the values is no number, or infinite; of depths only the former counts
};

struct Picture {
  std::string path;
  std::variant<deep::DeepImage, flat::Image> image;
  std::vector<Layer> layers;  // RGBA first where there is one

  // Null for a flat image, or a deep one.
  const deep::DeepImage* deep() const { return std::get_if<deep::DeepImage>(&image); }
  const flat::Image* flat() const { return std::get_if<flat::Image>(&image); }
  const Box& dataWindow() const;
  const Box& displayWindow() const;
  // The layer of that name, or else the first; null without channels.
  const Layer* layer(const std::string& name) const;
  size_t bytes() const;
};
using PicturePtr = std::shared_ptr<const Picture>;

// Groups an image's channels.
std::vector<Layer> layersOf(const deep::DeepImage& image);
std::vector<Layer> layersOf(const flat::Image& image);

PicturePtr makePicture(std::string path, std::variant<deep::DeepImage, flat::Image> image);

// Reads a file whole, the first deep part, or else the first. Throws Error, where it would take more bytes than `memory`,
// too, and Cancelled.
PicturePtr loadPicture(const std::string& path, size_t memory = size_t(8) << 30, const Progress& progress = {});

}  // namespace fathom::gui
