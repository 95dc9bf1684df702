// A flat image: planar float channels over a data window.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/buffer.h"
#include "flat/box.h"

namespace fathom::flat {

// Rows are dense (stride = data window width), row-major from the top. Values are premultiplied where the file's are.
struct Plane {
  std::string name;      // full EXR name: "R", "albedo.G"
  Buffer<float> values;  // dataWindow.area() elements

  std::span<const float> row(int width, int r) const {
    return {values.data() + size_t(r) * size_t(width), size_t(width)};
  }
};

struct Image {
  Box dataWindow;
  Box displayWindow;
  std::vector<Plane> planes;
  // Attributes of the file that io carries along, by name: int, float, string and matrices in OpenImageIO's text form.
  std::map<std::string, std::string> attributes;

  const Plane* find(std::string_view name) const;
  Plane* find(std::string_view name);
  // The plane, or an Error that names it.
  const Plane& get(std::string_view name) const;
  // Adds a plane of `value`; the name must be new. References to other planes end; their values stay where they are.
  Plane& add(std::string name, float value = 0);
  Image copy() const;
};

// The part of an image that lies in `box`, which lies in its data window; the display window stays.
Image crop(const Image& image, const Box& box);

}  // namespace fathom::flat
