#include "deep/clip_view.h"

#include "deep/clip.h"
#include "deep/flatten.h"

namespace fathom::deep {

flat::Image clipView(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                     const std::vector<std::string>& channels) {
  const flat::Image whole = flatten(clip(image, range.near, range.far));
  flat::Image result;
  result.dataWindow = {0, 0, (box.width() + step - 1) / step, (box.height() + step - 1) / step};
  result.displayWindow = result.dataWindow;
  std::vector<std::string> names = channels;
  if (std::find(names.begin(), names.end(), "A") == names.end()) names.push_back("A");
  for (const std::string& name : names) {
    const Buffer<float>& from = whole.get(name).values;
    Buffer<float>& to = result.add(name).values;
    for (int y = 0; y < result.dataWindow.y1; ++y)
      for (int x = 0; x < result.dataWindow.x1; ++x)
        if (whole.dataWindow.contains(box.x0 + x * step, box.y0 + y * step))
          to[result.dataWindow.index(x, y)] = from[whole.dataWindow.index(box.x0 + x * step, box.y0 + y * step)];
  }
  return result;
}

}  // namespace fathom::deep
