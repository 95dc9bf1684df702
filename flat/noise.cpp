#include "flat/noise.h"

#include <charconv>
#include <cmath>
#include <string>

#include "flat/error.h"
#include "flat/finite.h"

namespace fathom::flat {

namespace {

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

void fromHalves(const Image& image, Noise& noise) {
  const Plane *n0 = image.find("half0.samples"), *n1 = image.find("half1.samples");
  for (size_t c = 0; c < 3; ++c) {
    const HalfChannel a(image, "half0.", kRgbNames[c]), b(image, "half1.", kRgbNames[c]);
    if (!a.there() || !b.there())
      fail("channel {}: expected variance.* or half0.* and half1.* to know its noise, found neither", kRgbNames[c]);
    for (size_t i = 0; i < noise.variance[c].size(); ++i) {
      const float m = n0 && n1 ? n0->values[i] : 1, n = n0 && n1 ? n1->values[i] : 1;
      const float share = m > 0 && n > 0 ? m / (m + n) * (n / (m + n)) : 0;
      const float e = a.at(i) - b.at(i);
      noise.variance[c][i] = share * e * e;
    }
  }
}

// 0: the image does not tell.
int sppOf(const Image& image) {
  const auto found = image.attributes.find("fathom:spp");
  int spp = 0;
  if (found == image.attributes.end()) return 0;
  const std::string& text = found->second;
  return std::from_chars(text.data(), text.data() + text.size(), spp).ec == std::errc() && spp > 0 ? spp : 0;
}

float meanOf(const std::array<const Plane*, 3>& colour) {
  double sum = 0;
  size_t count = 0;
  for (const Plane* plane : colour)
    for (const float v : plane->values) {
      if (!isFinite(v)) continue;
      sum += double(v);
      ++count;
    }
  const double mean = count ? sum / double(count) : 0;
  return mean > 1e-20 && mean < double(kLargest) ? float(mean) : 0.5f;
}

}  // namespace

Noise noiseOf(const Image& image) {
  const size_t pixels = image.dataWindow.area();
  const std::array<const Plane*, 3> colour{&image.get("R"), &image.get("G"), &image.get("B")};
  Noise noise;
  noise.level = meanOf(colour);
  noise.pixel = Buffer<PixelNoise>(pixels);
  noise.samples = Buffer<float>(pixels, 1.0f);
  const bool variances = image.find("variance.R") && image.find("variance.G") && image.find("variance.B");
  for (size_t c = 0; c < 3; ++c)
    noise.variance[c] =
        variances ? image.get(std::string("variance.") + kRgbNames[c]).values.copy() : Buffer<float>(pixels);
  if (!variances) fromHalves(image, noise);
  const Plane* samples = image.find("samples");
  const int spp = sppOf(image);
  for (size_t i = 0; i < pixels; ++i) {
    const float count = samples ? samples->values[i] : float(spp);
    const bool told = samples || spp > 0;
    bool finite = true, still = true;
    for (size_t c = 0; c < 3; ++c) {
      const float v = noise.variance[c][i];
      finite = finite && isFinite(v) && v >= 0 && isFinite(colour[c]->values[i]);
      still = still && v == 0;
    }
    noise.pixel[i] = !finite              ? PixelNoise::Unknown
                     : !still             ? PixelNoise::Known
                     : !told || count > 1 ? PixelNoise::Converged
                                          : PixelNoise::Unknown;
    if (isFinite(count) && count > 1) noise.samples[i] = count;
    if (noise.pixel[i] != PixelNoise::Known)
      for (Buffer<float>& plane : noise.variance) plane[i] = 0;
  }
  return noise;
}

}  // namespace fathom::flat
