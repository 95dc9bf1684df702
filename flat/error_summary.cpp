#include "flat/error_summary.h"

#include <algorithm>
#include <string>

#include "flat/finite.h"

namespace fathom::flat {

namespace {

constexpr double kRelativeFloor = 0.01;  // as flat/metrics has it

struct Mean {
  double sum = 0;
  size_t count = 0;

  void add(double value) {
    sum += value;
    ++count;
  }
  void add(const Mean& other) {
    sum += other.sum;
    count += other.count;
  }
  double value() const { return count ? sum / double(count) : 0; }
};

}  // namespace

ErrorSummary summarizeErrors(const Image& result, const Noise& noise) {
  std::array<const float*, 3> colour, error;
  for (size_t c = 0; c < 3; ++c) {
    colour[c] = result.get(kRgbNames[c]).values.data();
    error[c] = result.get(std::string("error.") + kRgbNames[c]).values.data();
  }
  const Box& window = result.dataWindow;
  ErrorSummary summary;
  Mean whole, render;
  for (int y0 = window.y0; y0 < window.y1; y0 += kErrorTile)
    for (int x0 = window.x0; x0 < window.x1; x0 += kErrorTile) {
      const Box tile{x0, y0, std::min(x0 + kErrorTile, window.x1), std::min(y0 + kErrorTile, window.y1)};
      Mean mean;
      for (int y = tile.y0; y < tile.y1; ++y)
        for (int x = tile.x0; x < tile.x1; ++x) {
          const size_t i = window.index(x, y);
          for (size_t c = 0; c < 3; ++c) {
            if (!isFinite(colour[c][i]) || !isFinite(error[c][i])) continue;
            const double scale = double(colour[c][i]) * double(colour[c][i]) + kRelativeFloor;
            mean.add(double(error[c][i]) / scale);
            render.add(double(noise.variance[c][i]) / scale);
          }
        }
      whole.add(mean);
      summary.tiles.push_back({tile, mean.value()});
    }
  summary.relMse = whole.value();
  summary.render = render.value();
  return summary;
}

}  // namespace fathom::flat
