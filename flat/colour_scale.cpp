#include "flat/colour_scale.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "flat/tonemap.h"

namespace fathom::flat {

namespace {

// Lightness and chroma in Oklab, hue in degrees.
struct Lch {
  double lightness, chroma, hue;
};

double cube(double x) {
  return x * x * x;
}

std::array<float, 3> toSrgb(const Lch& colour) {
  const double angle = colour.hue * std::numbers::pi / 180;
  const double a = colour.chroma * std::cos(angle), b = colour.chroma * std::sin(angle);
  const double l = cube(colour.lightness + 0.3963377774 * a + 0.2158037573 * b);
  const double m = cube(colour.lightness - 0.1055613458 * a - 0.0638541728 * b);
  const double s = cube(colour.lightness - 0.0894841775 * a - 1.2914855480 * b);
  return {float(srgb(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s)),
          float(srgb(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s)),
          float(srgb(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s))};
}

// Murmur3's finaliser: every bit of the number has a say in every bit of the result.
uint32_t mixed(uint32_t x) {
  x = (x ^ x >> 16) * 0x85ebca6bu;
  x = (x ^ x >> 13) * 0xc2b2ae35u;
  return x ^ x >> 16;
}

}  // namespace

std::array<float, 3> evenColour(float t) {
  const double at = std::clamp(double(t), 0.0, 1.0);
  // The chroma stays inside of what sRGB can show at each lightness.
  return toSrgb({0.22 + 0.71 * at, 0.088 + 0.07 * cube(at), 300 - 195 * at});
}

std::array<float, 3> signedColour(float t) {
  const double at = std::min(1.0, std::abs(double(t)));
  return toSrgb({0.85 * at, 0.13 * std::min(1.0, 1.6 * at) * (1 - 0.45 * at * at), t < 0 ? 250.0 : 60.0});
}

std::array<float, 3> identifierColour(uint32_t id) {
  if (id == 0) return {0, 0, 0};
  // The golden section of the circle from one number to the next: hues of small numbers keep their distance.
  const uint32_t bits = mixed(id);
  return toSrgb(
      {0.55 + 0.3 * (bits >> 24) / 255, 0.07 + 0.06 * (bits >> 16 & 255) / 255, 360.0 * (id * 0x9e3779b9u) / 0x1p32});
}

}  // namespace fathom::flat
