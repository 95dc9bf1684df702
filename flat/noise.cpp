#include "flat/noise.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/level.h"

namespace fathom::flat {

namespace {

constexpr float kFewestConverged = 4;  // camera samples

constexpr int kDarkRadius = 2;
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

// One channel of a half: its own plane, or its components'.
struct HalfChannel {
  const Plane *whole = nullptr, *diffuse = nullptr, *specular = nullptr;

  HalfChannel(const Image& image, const std::string& half, const std::string& channel)
      : whole(image.find(half + channel)),
        diffuse(image.find(half + "diffuse." + channel)),
        specular(image.find(half + "specular." + channel)) {}
  bool there() const { return whole || (diffuse && specular); }
  float at(size_t i) const { return whole ? whole->values[i] : diffuse->values[i] + specular->values[i]; }
};

bool hasVariances(const Image& image) {
  return image.find("variance.R") && image.find("variance.G") && image.find("variance.B");
}

void fromHalves(const Image& image, Noise& noise) {
  const Plane *n0 = image.find("half0.samples"), *n1 = image.find("half1.samples");
  for (size_t c = 0; c < 3; ++c) {
    const HalfChannel a(image, "half0.", kRgbNames[c]), b(image, "half1.", kRgbNames[c]);
    if (!a.there() || !b.there())
      fail("channel {}: expected variance.* or half0.* and half1.* to know its noise, found neither", kRgbNames[c]);
    for (size_t i = 0; i < noise.variance[c].size(); ++i) {
      const float m = n0 && n1 ? n0->values[i] : 1, n = n0 && n1 ? n1->values[i] : 1;
      const float share = m > 0 && n > 0 ? m / (m + n) * (n / (m + n)) : m > 0 || n > 0 ? kUnknown : 0;
      const float e = a.at(i) - b.at(i);
      noise.variance[c][i] = share * e * e;
    }
  }
}

float levelOf(const std::array<const Plane*, 3>& colour) {
  LevelSum level;
  for (const Plane* plane : colour)
    for (const float v : plane->values) level.add(double(v));
  return level.result();
}

// Black pixels beside others that are not are not taken for converged.
void doubtLoneBlack(const Box& window, const Buffer<uint8_t>& dark, Noise& noise) {
  const int width = window.width(), height = window.height();
  parallelFor(0, height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const size_t i = size_t(y) * size_t(width) + size_t(x);
      if (!dark[i] || noise.pixel[i] != PixelNoise::Converged) continue;
      for (int yq = std::max(0, y - kDarkRadius); yq <= std::min(height - 1, y + kDarkRadius); ++yq)
        for (int xq = std::max(0, x - kDarkRadius); xq <= std::min(width - 1, x + kDarkRadius); ++xq)
          if (!dark[size_t(yq) * size_t(width) + size_t(xq)]) noise.pixel[i] = PixelNoise::Known;
    }
  });
}

}  // namespace

int sppOf(const Image& image) {
  const auto found = image.attributes.find("fathom:spp");
  int spp = 0;
  if (found == image.attributes.end()) return 0;
  const std::string& text = found->second;
  return std::from_chars(text.data(), text.data() + text.size(), spp).ec == std::errc() && spp > 0 ? spp : 0;
}

bool tellsNoise(const Image& image) {
  if (hasVariances(image)) return true;
  return std::ranges::all_of(kRgbNames, [&](const char* name) {
    return HalfChannel(image, "half0.", name).there() && HalfChannel(image, "half1.", name).there();
  });
}

Noise noiseOf(const Image& image) {
  const size_t pixels = image.dataWindow.area();
  const std::array<const Plane*, 3> colour{&image.get("R"), &image.get("G"), &image.get("B")};
  Noise noise;
  noise.level = levelOf(colour);
  noise.pixel = Buffer<PixelNoise>(pixels);
  noise.samples = Buffer<float>(pixels, 1.0f);
  const bool variances = hasVariances(image);
  for (size_t c = 0; c < 3; ++c)
    noise.variance[c] =
        variances ? image.get(std::string("variance.") + kRgbNames[c]).values.copy() : Buffer<float>(pixels);
  if (!variances) fromHalves(image, noise);
  const Plane* samples = image.find("samples");
  const int spp = sppOf(image);
  Buffer<uint8_t> dark(pixels);  // black and without variance
  for (size_t i = 0; i < pixels; ++i) {
    const float count = samples ? samples->values[i] : spp > 0 ? float(spp) : kFewestConverged;
    bool finite = true, still = true, black = true;
    for (size_t c = 0; c < 3; ++c) {
      const float v = noise.variance[c][i];
      finite = finite && isFinite(v) && v >= 0 && isFinite(colour[c]->values[i]);
      still = still && v == 0;
      black = black && colour[c]->values[i] == 0;
    }
    dark[i] = still && black;
    noise.pixel[i] = !finite || (still && !(count >= kFewestConverged)) ? PixelNoise::Unknown
                     : still                                            ? PixelNoise::Converged
                                                                        : PixelNoise::Known;
    if (isFinite(count) && count > 1 && (samples || spp > 0)) noise.samples[i] = count;
    if (noise.pixel[i] != PixelNoise::Known)
      for (Buffer<float>& plane : noise.variance) plane[i] = 0;
  }
  doubtLoneBlack(image.dataWindow, dark, noise);
  return noise;
}

}  // namespace fathom::flat
