#include "flat/perturb.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/parallel.h"
#include "flat/finite.h"

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

// The difference of the halves of a channel, each of its components' sum where it has no plane of its own.
Buffer<float> halfDifference(const Image& image, const std::string& channel) {
  Buffer<float> result(image.dataWindow.area(), 0.0f);
  const bool whole = image.find("half0." + channel) && image.find("half1." + channel);
  for (const char* group : {"", "diffuse.", "specular."}) {
    if (whole != (*group == 0)) continue;
    const Plane *a = image.find("half0." + (group + channel)), *b = image.find("half1." + (group + channel));
    for (size_t i = 0; a && b && i < result.size(); ++i) result[i] += a->values[i] - b->values[i];
  }
  for (float& v : result) v = finiteOrZero(v);
  return result;
}

Buffer<float> product(const Buffer<float>& a, const Buffer<float>& b) {
  Buffer<float> result(a.size());
  for (size_t i = 0; i < a.size(); ++i) result[i] = a[i] * b[i];
  return result;
}

}  // namespace

Perturber::Perturber(const Image& noisy, const Noise& noise) : noisy_(noisy), noise_(noise) {
  findShares();
  findAlbedo();
}

void Perturber::findShares() {
  for (size_t c = 0; c < 3; ++c) {
    const std::string d = std::string("diffuse.") + kRgbNames[c], s = std::string("specular.") + kRgbNames[c];
    const Plane *diffuse = noisy_.find(d), *specular = noisy_.find(s);
    if (!diffuse || !specular) return;
    const Buffer<float> a = pooled(noisy_.dataWindow, componentVariance(noisy_, d)),
                        b = pooled(noisy_.dataWindow, componentVariance(noisy_, s));
    diffuse_[c] = Buffer<float>(a.size());
    for (size_t i = 0; i < a.size(); ++i) diffuse_[c][i] = shareOf(a[i], b[i], diffuse->values[i], specular->values[i]);
  }
}

void Perturber::findAlbedo() {
  for (size_t c = 0; c < 3; ++c) {
    const std::string albedo = std::string("albedo.") + kRgbNames[c];
    if (!noisy_.find(albedo) || !noisy_.find("half0." + albedo) || !noisy_.find("half1." + albedo)) return;
    const Buffer<float> a = halfDifference(noisy_, albedo), x = halfDifference(noisy_, kRgbNames[c]);
    const Box& window = noisy_.dataWindow;
    const Buffer<float> both = pooled(window, product(a, x)), ofAlbedo = pooled(window, product(a, a)),
                        ofColour = pooled(window, product(x, x)), variance = componentVariance(noisy_, albedo);
    albedo_[c] = Buffer<float>(a.size());
    for (size_t i = 0; i < a.size(); ++i) {
      const float most = std::sqrt(ofAlbedo[i]) * std::sqrt(ofColour[i]);
      const float correlation = most > 0 ? std::clamp(both[i] / most, -1.0f, 1.0f) : 0;
      albedo_[c][i] = correlation * std::sqrt(variance[i]);
    }
  }
}

Image Perturber::moved(uint64_t seed, int probe, float size) const {
  Image image = noisy_.copy();
  move("", 0, seed, probe, size, image);
  move("half0.", 1, seed, probe, size, image);
  move("half1.", -1, seed, probe, size, image);
  return image;
}

// Moves the means, or the half whose sign and name are given.
void Perturber::move(const std::string& half, float sign, uint64_t seed, int probe, float size, Image& image) const {
  const Box& window = image.dataWindow;
  const Plane *mine = nullptr, *theirs = nullptr;
  if (!half.empty()) {
    mine = noisy_.find(half + "samples");
    theirs = noisy_.find(half == "half0." ? "half1.samples" : "half0.samples");
  }
  for (size_t c = 0; c < 3; ++c) {
    Plane* const planes[4] = {image.find(half + kRgbNames[c]), image.find(half + "diffuse." + kRgbNames[c]),
                              image.find(half + "specular." + kRgbNames[c]),
                              image.find(half + "albedo." + kRgbNames[c])};
    parallelFor(window.y0, window.y1, [&](int y) {
      for (int x = window.x0; x < window.x1; ++x) {
        const size_t i = size_t(y - window.y0) * size_t(window.width()) + size_t(x - window.x0);
        const float deviation = std::sqrt(noise_.variance[c][i]);
        const float own = mine && theirs ? mine->values[i] : 1, other = mine && theirs ? theirs->values[i] : 1;
        if (!(deviation > 0) || !(own > 0)) continue;
        const Signs signs = signsOf(seed, probe, x, y);
        const float steps = size * (signs.ofMean + sign * signs.ofHalves * std::sqrt(std::max(other, 0.0f) / own));
        const float diffuse = diffuse_[c].empty() ? 0.5f : diffuse_[c][i];
        const float moves[4] = {deviation, deviation * diffuse, deviation * (1 - diffuse),
                                albedo_[c].empty() ? 0 : albedo_[c][i]};
        for (size_t k = 0; k < 4; ++k)
          if (planes[k]) planes[k]->values[i] += steps * moves[k];
      }
    });
  }
}

}  // namespace fathom::flat
