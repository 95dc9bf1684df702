#include "flat/perturb.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "flat/finite.h"
#include "flat/parallel.h"

namespace fathom::flat {

namespace {

constexpr int kShareRadius = 2;  // two-buffer variances are pooled over 5x5 pixels

// Vigna's SplitMix64: a well-mixed function of its argument.
uint64_t mixed(uint64_t z) {
  z += 0x9e3779b97f4a7c15;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return z ^ (z >> 31);
}

struct Signs {
  float ofMean, ofHalves;
};

Signs signsOf(uint64_t seed, int probe, int x, int y) {
  const uint64_t place = uint64_t(uint32_t(x)) << 32 | uint32_t(y);
  const uint64_t bits = mixed(mixed(mixed(seed) + uint64_t(uint32_t(probe))) ^ place);
  return {bits >> 63 ? 1.0f : -1.0f, bits >> 62 & 1 ? 1.0f : -1.0f};
}

// The variance of one component's channel: from the file, or the two buffers' (in units of its own for equal halves).
Buffer<float> componentVariance(const Image& image, const std::string& channel) {
  const size_t pixels = image.dataWindow.area();
  const Plane* told = image.find("variance." + channel);
  const Plane *a = image.find("half0." + channel), *b = image.find("half1." + channel);
  Buffer<float> result(pixels, 0.0f);
  for (size_t i = 0; i < pixels; ++i) {
    const float e = a && b && !told ? 0.5f * (a->values[i] - b->values[i]) : 0;
    const float v = told ? told->values[i] : e * e;
    result[i] = isFinite(v) ? std::max(v, 0.0f) : 0;
  }
  return result;
}

Buffer<float> pooled(const Box& window, const Buffer<float>& values) {
  Buffer<float> result(values.size());
  const int width = window.width(), height = window.height();
  parallelFor(0, height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      float sum = 0;
      for (int yq = std::max(0, y - kShareRadius); yq <= std::min(height - 1, y + kShareRadius); ++yq)
        for (int xq = std::max(0, x - kShareRadius); xq <= std::min(width - 1, x + kShareRadius); ++xq)
          sum += values[size_t(yq) * size_t(width) + size_t(xq)];
      result[size_t(y) * size_t(width) + size_t(x)] = sum;
    }
  });
  return result;
}

// Without variances, the components' light decides.
float shareOf(float varianceA, float varianceB, float lightA, float lightB) {
  if (varianceA + varianceB > 0) return varianceA / (varianceA + varianceB);
  const float a = std::abs(finiteOrZero(lightA)), b = std::abs(finiteOrZero(lightB));
  return a + b > 0 ? a / (a + b) : 0.5f;
}

}  // namespace

Perturber::Perturber(const Image& noisy, const Noise& noise) : noisy_(noisy), noise_(noise) {
  for (size_t c = 0; c < 3; ++c) {
    const std::string d = std::string("diffuse.") + kRgbNames[c], s = std::string("specular.") + kRgbNames[c];
    const Plane *diffuse = noisy.find(d), *specular = noisy.find(s);
    if (!diffuse || !specular) return;
    const Buffer<float> a = pooled(noisy.dataWindow, componentVariance(noisy, d)),
                        b = pooled(noisy.dataWindow, componentVariance(noisy, s));
    diffuse_[c] = Buffer<float>(a.size());
    for (size_t i = 0; i < a.size(); ++i) diffuse_[c][i] = shareOf(a[i], b[i], diffuse->values[i], specular->values[i]);
  }
}

float Perturber::shareOfDiffuse(size_t channel, size_t pixel) const {
  return diffuse_[channel].empty() ? 0.5f : diffuse_[channel][pixel];
}

Image Perturber::moved(uint64_t seed, int probe, float size) const {
  Image image = noisy_.copy();
  const Box& window = image.dataWindow;
  const Plane *n0 = noisy_.find("half0.samples"), *n1 = noisy_.find("half1.samples");
  // The step of the mean, or of a half that has `own` camera samples where the other has `other`.
  const auto move = [&](const std::string& prefix, float sign, const Plane* own, const Plane* other) {
    for (size_t c = 0; c < 3; ++c) {
      Plane* const planes[3] = {image.find(prefix + kRgbNames[c]), image.find(prefix + "diffuse." + kRgbNames[c]),
                                image.find(prefix + "specular." + kRgbNames[c])};
      parallelFor(window.y0, window.y1, [&](int y) {
        for (int x = window.x0; x < window.x1; ++x) {
          const size_t i = size_t(y - window.y0) * size_t(window.width()) + size_t(x - window.x0);
          const float deviation = size * std::sqrt(noise_.variance[c][i]);
          const float mine = own && other ? own->values[i] : 1, theirs = own && other ? other->values[i] : 1;
          if (!(deviation > 0) || !(mine > 0)) continue;
          const Signs signs = signsOf(seed, probe, x, y);
          const float step =
              deviation * (signs.ofMean + sign * signs.ofHalves * std::sqrt(std::max(theirs, 0.0f) / mine));
          const float diffuse = shareOfDiffuse(c, i);
          const float steps[3] = {step, step * diffuse, step * (1 - diffuse)};
          for (size_t k = 0; k < 3; ++k)
            if (planes[k]) planes[k]->values[i] += steps[k];
        }
      });
    }
  };
  move("", 0, nullptr, nullptr);
  move("half0.", 1, n0, n1);
  move("half1.", -1, n1, n0);
  return image;
}

}  // namespace fathom::flat
