#include "flat/image.h"

#include <algorithm>

#include "base/error.h"

namespace fathom::flat {

const Plane* Image::find(std::string_view name) const {
  const auto it = std::find_if(planes.begin(), planes.end(), [&](const Plane& p) { return p.name == name; });
  return it == planes.end() ? nullptr : &*it;
}

Plane* Image::find(std::string_view name) {
  return const_cast<Plane*>(std::as_const(*this).find(name));
}

const Plane& Image::get(std::string_view name) const {
  if (const Plane* plane = find(name)) return *plane;
  fail("channel {}: expected in the image, found none", name);
}

Plane& Image::add(std::string name, float value) {
  return planes.emplace_back(Plane{std::move(name), Buffer<float>(dataWindow.area(), value)});
}

Image Image::copy() const {
  Image result{dataWindow, displayWindow, {}, attributes};
  for (const Plane& plane : planes) result.planes.push_back({plane.name, plane.values.copy()});
  return result;
}

Image crop(const Image& image, const Box& box) {
  Image result{box, image.displayWindow, {}, image.attributes};
  const size_t width = size_t(image.dataWindow.width()), cut = size_t(box.width());
  const size_t first = size_t(box.y0 - image.dataWindow.y0) * width + size_t(box.x0 - image.dataWindow.x0);
  for (const Plane& plane : image.planes) {
    Buffer<float>& out = result.planes.emplace_back(Plane{plane.name, Buffer<float>(box.area())}).values;
    for (size_t y = 0; y < size_t(box.height()); ++y)
      std::copy_n(plane.values.begin() + first + y * width, cut, out.begin() + y * cut);
  }
  return result;
}

}  // namespace fathom::flat
