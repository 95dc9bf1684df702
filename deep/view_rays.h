// The rays that pixels look along, in world space.
#pragma once

#include <optional>

#include "deep/attributes.h"
#include "flat/box.h"

namespace fathom::deep {

// Where a pixel looks: per unit of depth (distance along the view axis) the length of its ray, and the coordinate of
// its points along one axis of the world, which is start + depth * slope.
struct ViewRay {
  double length = 1, start = 0, slope = 0;
};

enum class Axis { X, Y, Z };

// A pinhole in the middle of the display window, square pixels. Its scale comes from `fieldOfView` (horizontal, in
// degrees), or else from what findPpuScale takes; its place from worldToCamera, in the sense of the OpenEXR standard:
// row vectors, x right, y up. Cameras look along +z, or along -z where worldToNDC has that in front.
class ViewRays {
 public:
  ViewRays(const Attributes& attributes, const Box& displayWindow, std::optional<float> fieldOfView, Axis axis);

  bool hasScale() const { return scale_ > 0; }  // else all rays are taken for parallel, of length 1
  bool hasPlace() const { return placed_; }     // else `start` and `slope` are 0
  // Of the middle of a pixel.
  ViewRay at(int x, int y) const;

 private:
  double scale_ = 0;  // pixels per unit at depth 1
  double middleX_, middleY_;
  bool placed_ = false;
  double start_ = 0, right_ = 0, up_ = 0, forward_ = 0;  // the camera's place and axes along the world's axis
};

}  // namespace fathom::deep
