// Noisy frames of values at the ends of what files hold, for the stress of the denoisers: deep bins and flat pixels with all
// that the channel convention knows.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "deep/denoise.h"
#include "deep/image.h"
#include "deep/one_bin.h"

namespace fathom::stress {

inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
inline constexpr float kAlmostOne = 0x1.fffffep-1f;  // 1 - 2^-24

// Numbers over many powers of ten.
class Draw {
 public:
  explicit Draw(unsigned seed) : random_(seed) {}
  unsigned below(unsigned count) { return unsigned(random_() % count); }
  double uniform(double from = 0, double to = 1) { return from + (to - from) * double(random_()) / 4294967296.0; }
  double power(double from, double to) { return std::exp(uniform(std::log(from), std::log(to))); }
  double normal() { return normal_(random_); }
  float of(std::initializer_list<float> some) { return some.begin()[below(unsigned(some.size()))]; }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

struct ExtremeParams {
  int width = 24, height = 17, x0 = -5, y0 = -3;
  unsigned seed = 1;
  unsigned mostBins = 4;
  double empty = 0.15;   // part of the pixels
  float largest = 6e4f;  // light that is drawn
  bool components = true, features = true;
};

namespace detail {

struct ExtremeBin {
  float alpha, z;
  float count, half0;             // camera samples, and those of the first half
  double light[2];                // of the two components, not premultiplied
  double wobble;                  // relative noise
  std::array<float, 3> variance;  // of the mean
};

// A pixel's bins front to back, depths strictly ascending: some one ulp apart, the last one infinite at times.
inline std::vector<ExtremeBin> extremePixel(const ExtremeParams& p, double magnitude, Draw& draw) {
  std::vector<ExtremeBin> bins(draw.uniform() < p.empty ? 0 : 1 + draw.below(p.mostBins));
  float z = float(draw.power(1e-6, 1e3));
  for (ExtremeBin& bin : bins) {
    bin.z = z;
    z = draw.below(3) == 0 ? std::nextafter(z, kInfinity) : std::min(z * float(draw.power(1.0001, 1e6)), 1e9f);
    if (!(z > bin.z)) z = std::nextafter(bin.z, kInfinity);
    bin.alpha = draw.below(3) ? float(draw.uniform()) : draw.of({0, 1e-30f, 1e-7f, 1e-3f, kAlmostOne, 1});
    bin.count = draw.of({0, 1, 2, 3, 8, 64, 10000});
    bin.half0 = draw.below(2) ? std::floor(bin.count / 2) : draw.of({0, 1, bin.count - 1, bin.count});
    bin.half0 = std::clamp(bin.half0, 0.0f, bin.count);
    for (double& light : bin.light)
      light = draw.below(4) ? magnitude * draw.uniform(0.5, 2) : draw.power(1e-45, double(p.largest));
    bin.wobble = draw.of({0, 0.01f, 0.3f, 2});
    for (float& v : bin.variance) {
      const double s = (bin.light[0] + bin.light[1]) * bin.wobble;
      v = draw.below(6) ? float(std::min(s * s, 1e14)) : draw.of({0, 1e-38f, 1e14f});
    }
  }
  if (!bins.empty() && draw.below(3) == 0) bins.back().alpha = 1;
  if (!bins.empty() && draw.below(12) == 0) bins.back().z = kInfinity;
  return bins;
}

}  // namespace detail

// Bins, tidy. Blocks of 6x6 pixels have light of one magnitude, but for a quarter of the bins, so that some have neighbours
// that are alike.
inline deep::DeepImage extremeDeep(const ExtremeParams& p = {}) {
  Draw draw(p.seed);
  std::vector<double> magnitudes(64);
  for (double& m : magnitudes) m = draw.below(2) ? draw.uniform(0.1, 1) : draw.power(1e-44, double(p.largest));
  deep::DeepImage image;
  image.dataWindow = image.displayWindow = {p.x0, p.y0, p.x0 + p.width, p.y0 + p.height};
  image.offsets = Buffer<uint64_t>(image.pixels() + 1, uint64_t(0));
  std::vector<detail::ExtremeBin> bins;
  for (int y = 0; y < p.height; ++y)
    for (int x = 0; x < p.width; ++x) {
      const auto here = detail::extremePixel(p, magnitudes[size_t(x / 6 + 7 * (y / 6)) % 64], draw);
      bins.insert(bins.end(), here.begin(), here.end());
      image.offsets[size_t(y) * size_t(p.width) + size_t(x) + 1] = bins.size();
    }
  const auto fill = [&](const std::string& name, auto value) {
    Buffer<float>& values = image.add(name, deep::PixelType::Float).values;
    for (size_t i = 0; i < bins.size(); ++i) values[i] = float(value(bins[i]));
  };
  fill("A", [](const auto& b) { return b.alpha; });
  fill("Z", [](const auto& b) { return b.z; });
  fill("samples", [](const auto& b) { return b.count; });
  fill("half0.samples", [](const auto& b) { return b.half0; });
  fill("half1.samples", [](const auto& b) { return b.count - b.half0; });
  const auto shade = [](const auto& b) { return b.alpha > 0 ? double(b.alpha) : 1.0; };
  for (size_t c = 0; c < 3; ++c) {
    const std::string rgb(1, "RGB"[c]), xyz(1, "XYZ"[c]);
    for (size_t l = 0; l < 2 && p.components; ++l) {
      const std::string layer = l ? "specular." : "diffuse.";
      for (const char* half : {"half0.", "half1."})
        fill(fmt::format("{}{}{}", half, layer, rgb), [&](const auto& b) {
          const double value = shade(b) * b.light[l] * (1 + b.wobble * draw.normal());
          const float count = *(half + 4) == '0' ? b.half0 : b.count - b.half0;
          return count > 0 ? std::clamp(value, -1e15, 1e15) : 0.0;
        });
      fill(layer + rgb, [&](const auto&) { return 0.0; });
      const auto a = image.get(fmt::format("half0.{}{}", layer, rgb)),
                 b = image.get(fmt::format("half1.{}{}", layer, rgb));
      const auto n = image.get("samples"), n0 = image.get("half0.samples"), mean = image.get(layer + rgb);
      for (size_t i = 0; i < bins.size(); ++i)
        mean[i] = n[i] > 0 ? float((double(n0[i]) * double(a[i]) + double(n[i] - n0[i]) * double(b[i])) / double(n[i]))
                           : float(shade(bins[i]) * bins[i].light[l]);
    }
    for (const std::string half : {"", "half0.", "half1."}) {
      if (p.components) {
        fill(half + rgb, [](const auto&) { return 0.0; });
        const auto d = image.get(fmt::format("{}diffuse.{}", half, rgb)),
                   s = image.get(fmt::format("{}specular.{}", half, rgb)), sum = image.get(half + rgb);
        for (size_t i = 0; i < bins.size(); ++i) sum[i] = d[i] + s[i];
      } else {
        fill(half + rgb, [&](const auto& b) { return shade(b) * b.light[0] * (1 + b.wobble * draw.normal()); });
      }
      if (!p.features) continue;
      fill(fmt::format("{}albedo.{}", half, rgb), [&](const auto& b) {
        return double(b.alpha) * (draw.below(4) ? draw.uniform() : double(draw.of({0, 1e-30f, 1e-5f, 1, 50})));
      });
    }
    fill("variance." + rgb, [&](const auto& b) { return b.variance[c]; });
    if (!p.features) continue;
    fill("variance.albedo." + rgb, [&](const auto&) { return draw.of({0, 1e-5f, 1e-3f, 1e10f}); });
    fill("N." + xyz, [&](const auto& b) { return double(b.alpha) * draw.uniform(-1, 1); });
    fill("variance.N." + xyz, [&](const auto&) { return draw.of({0, 1e-5f, 1e-2f, 1e10f}); });
  }
  if (p.features) fill("variance.Z", [&](const auto&) { return draw.of({0, 1e-10f, 1, 1e14f}); });
  image.attributes.set("fathom:spp", 64);
  return image;
}

// The same as flat pixels, one bin each: A is the pixel's alpha, Z its depth.
inline flat::Image extremeFlat(ExtremeParams p = {}) {
  p.mostBins = 1;
  p.empty = 0;
  flat::Image image = deep::toFlat(extremeDeep(p));
  for (flat::Plane& plane : image.planes)
    if (plane.name == "A") plane.values.fill(1);
  image.attributes["fathom:spp"] = "64";
  return image;
}

inline deep::DenoisePlan planFor(const deep::DeepImage& image, const deep::DenoiseParams& params = {}) {
  std::vector<std::string> names;
  for (const deep::Channel& channel : image.channels) names.push_back(channel.name);
  return {deep::findDenoiseInputs(names, image.attributes), params, deep::meanLevel(image)};
}

// What a channel is multiplied with where all light is multiplied with `scale`: that, its square for variances, or 1.
inline float factorOf(std::string_view name, float scale) {
  const bool variance = name.starts_with("variance.");
  if (variance) name.remove_prefix(9);
  for (const std::string_view prefix : {"half0.", "half1.", "diffuse.", "specular."})
    if (name.starts_with(prefix)) name.remove_prefix(prefix.size());
  if (name != "R" && name != "G" && name != "B") return 1;
  return variance ? scale * scale : scale;
}

inline deep::DeepImage scaled(const deep::DeepImage& image, float scale) {
  deep::DeepImage result = image.copy();
  for (deep::Channel& channel : result.channels)
    for (float& v : channel.values) v *= factorOf(channel.name, scale);
  return result;
}

inline flat::Image scaled(const flat::Image& image, float scale) {
  flat::Image result = image.copy();
  for (flat::Plane& plane : result.planes)
    for (float& v : plane.values) v *= factorOf(plane.name, scale);
  return result;
}

inline bool sameBits(float a, float b) {
  return std::bit_cast<uint32_t>(a) == std::bit_cast<uint32_t>(b);
}

// Twelve powers of ten, as powers of two, which change no digits, and of ten, which do.
inline constexpr float kExactScales[] = {0x1p-20f, 0x1p-13f, 0x1p-7f, 0x1p6f, 0x1p13f, 0x1p20f};
inline constexpr float kRoundedScales[] = {1e-6f, 1e-4f, 1e-2f, 1e2f, 1e4f, 1e6f};

}  // namespace fathom::stress
