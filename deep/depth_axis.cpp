#include "deep/depth_axis.h"

#include <algorithm>
#include <limits>

namespace fathom::deep {

namespace {

constexpr double kRoom = 0.04;  // of the axis, on each side

constexpr double kLeast = 1e-6;  // length of an axis, of the depths on it

// The smallest 1, 2 or 5 times a power of ten that is at least `step`.
double roundStep(double step) {
  const double power = std::pow(10, std::floor(std::log10(step)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= step * (1 - 1e-9)) return factor * power;
  return 10 * power;
}

std::vector<double> evenTicks(const DepthAxis& axis, int most) {
  const double length = axis.far - axis.near;
  double step = roundStep(length / most);
  if (std::floor(axis.far / step) - std::ceil(axis.near / step) + 1 > most) step = roundStep(step * 1.5);
  std::vector<double> result;
  const auto first = std::llround(std::ceil(axis.near / step)), last = std::llround(std::floor(axis.far / step));
  for (auto i = first; i <= last; ++i) result.push_back(double(i) * step);
  return result;
}

std::vector<double> powerTicks(const DepthAxis& axis, std::initializer_list<double> factors, int every) {
  std::vector<double> result;
  const int first = int(std::floor(std::log10(axis.near) / every)) * every, last = int(std::ceil(std::log10(axis.far)));
  for (int exponent = first; exponent <= last; exponent += every)
    for (const double factor : factors) {
      const double depth = factor * std::pow(10, exponent);
      if (depth >= axis.near && depth <= axis.far) result.push_back(depth);
    }
  return result;
}

}  // namespace

std::vector<float> cellPlanes(const DepthAxis& axis, int cells) {
  std::vector<float> planes(size_t(cells) + 1);
  for (size_t i = 0; i < planes.size(); ++i) planes[i] = float(axis.depth(double(i) / cells));
  planes.back() = std::nextafter(float(axis.far), std::numeric_limits<float>::infinity());
  return planes;
}

DepthAxis axisAround(double nearest, double farthest, bool logarithmic) {
  if (!(nearest <= farthest)) return {};
  if (logarithmic && nearest > 0) {
    const double room = std::max(std::pow(farthest / nearest, kRoom), 1.0005);
    return {nearest / room, farthest * room, true};
  }
  const double room = std::max({kRoom * (farthest - nearest), 0.0005 * std::abs(nearest), 1e-30});
  return {nearest - room, farthest + room, false};
}

DepthAxis zoomed(const DepthAxis& axis, const DepthAxis& whole, double place, double factor) {
  DepthAxis result = axis;
  result.near = std::max(axis.depth(place - place * factor), whole.near);
  result.far = std::min(axis.depth(place + (1 - place) * factor), whole.far);
  const double least = kLeast * std::max(std::abs(result.near), std::abs(result.far));
  return result.far - result.near > least ? result : axis;
}

std::vector<double> ticks(const DepthAxis& axis, int most) {
  if (!axis.logarithmic || axis.far < 10 * axis.near) return evenTicks(axis, most);
  std::vector<double> result = powerTicks(axis, {1, 2, 5}, 1);
  for (int every = 1; int(result.size()) > most; every *= 2) result = powerTicks(axis, {1}, every);
  return result;
}

}  // namespace fathom::deep
