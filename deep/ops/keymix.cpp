// Both images are put into one, side by side, so that one plan can take samples of each.
#include "deep/ops/keymix.h"

#include <algorithm>
#include <array>
#include <vector>

#include "deep/ops/area_mean.h"
#include "deep/ops/crop.h"
#include "deep/ops/merge.h"
#include "deep/ops/sample_plan.h"
#include "deep/tidy.h"

namespace fathom::deep {

namespace {

// One image above the other, both over the same window; tidy.
DeepImage stack(const DeepImage& upper, const DeepImage& lower, const Box& window) {
  std::vector<DeepImage> both;
  both.push_back(toWindow(upper, window));
  both.push_back(toWindow(lower, window));
  both[0].dataWindow = {0, 0, window.width(), window.height()};
  both[1].dataWindow = {0, window.height(), window.width(), 2 * window.height()};
  DeepImage all = merge(both);
  dropSampleStatistics(all);
  return tidy(std::move(all)).image;
}

}  // namespace

DeepImage keymix(const DeepImage& one, const DeepImage& zero, const flat::Image& matte, std::string_view channel) {
  const Buffer<float>& values = matte.get(channel).values;
  const Box window = unionOf(one.dataWindow, zero.dataWindow);
  const DeepImage both = stack(one, zero, window);
  const auto matteAt = [&](int x, int y) {
    const float m = matte.dataWindow.contains(x, y) ? values[matte.dataWindow.index(x, y)] : 0;
    return m > 0 ? std::min(double(m), 1.0) : 0;
  };
  std::vector<RowPlan> rows(size_t(window.height()));
  parallelFor(0, window.height(), [&](int row) {
    AreaMean mean(both, 0);
    for (int x = 0; x < window.width(); ++x) {
      const double m = matteAt(window.x0 + x, window.y0 + row);
      const size_t pixel = both.dataWindow.index(x, row);
      const std::array<PixelShare, 2> shares = {{{pixel, m}, {pixel + window.area(), 1 - m}}};
      const std::span<const PixelShare> all(shares);
      mean.add(m == 1 ? all.first(1) : (m == 0 ? all.last(1) : all), rows[size_t(row)]);
    }
  });
  return applyPlan(both, window, rows);
}

}  // namespace fathom::deep
