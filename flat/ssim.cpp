#include "flat/ssim.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/parallel.h"

namespace fathom::flat {

namespace {

constexpr int kRadius = 5;
constexpr double kSigma = 1.5, kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;

// Weighted sums over a window, or over a row of one.
struct Moments {
  double weight = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;

  void add(double w, const Moments& m) {
    weight += w * m.weight;
    x += w * m.x, y += w * m.y;
    xx += w * m.xx, yy += w * m.yy, xy += w * m.xy;
  }
  double ssim() const {
    const double mx = x / weight, my = y / weight;
    const double vx = xx / weight - mx * mx, vy = yy / weight - my * my, cov = xy / weight - mx * my;
    return (2 * mx * my + kC1) * (2 * cov + kC2) / ((mx * mx + my * my + kC1) * (vx + vy + kC2));
  }
};

std::array<double, 2 * kRadius + 1> gaussian() {
  std::array<double, 2 * kRadius + 1> result;
  for (int i = -kRadius; i <= kRadius; ++i) result[size_t(i + kRadius)] = std::exp(-i * i / (2 * kSigma * kSigma));
  return result;
}

// How far from an edge the first window centre lies.
int margin(int size) {
  return size > 2 * kRadius ? kRadius : 0;
}

// The window along a row or a column of `size` elements around `centre`: sum of weight times at(position).
template <class At>
Moments gather(int centre, int size, const At& at) {
  static const auto weights = gaussian();
  Moments sum;
  for (int i = std::max(centre - kRadius, 0); i <= std::min(centre + kRadius, size - 1); ++i)
    sum.add(weights[size_t(i - centre + kRadius)], at(i));
  return sum;
}

}  // namespace

double ssim(std::span<const float> x, std::span<const float> y, std::span<const uint8_t> used, int width, int height) {
  const auto index = [&](int column, int row) { return size_t(row) * size_t(width) + size_t(column); };
  std::vector<Moments> alongRows(x.size());
  parallelFor(0, height, [&](int row) {
    for (int column = 0; column < width; ++column)
      alongRows[index(column, row)] = gather(column, width, [&](int at) -> Moments {
        const size_t i = index(at, row);
        if (!used[i]) return {};
        const double a = x[i], b = y[i];
        return {1, a, b, a * a, b * b, a * b};
      });
  });
  std::vector<double> sums(size_t(height), 0);
  std::vector<size_t> counts(size_t(height), 0);
  const int mx = margin(width), my = margin(height);
  parallelFor(my, height - my, [&](int row) {
    for (int column = mx; column < width - mx; ++column) {
      if (!used[index(column, row)]) continue;
      sums[size_t(row)] += gather(row, height, [&](int at) { return alongRows[index(column, at)]; }).ssim();
      ++counts[size_t(row)];
    }
  });
  double sum = 0;
  size_t count = 0;
  for (size_t row = 0; row < sums.size(); ++row) sum += sums[row], count += counts[row];
  return count ? sum / double(count) : 1;
}

}  // namespace fathom::flat
