#include "flat/mix.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/neighbourhood.h"

namespace fathom::flat {

namespace {

using Planes = std::array<const float*, 3>;

Planes coloursOf(const Image& image) {
  return {image.get("R").values.data(), image.get("G").values.data(), image.get("B").values.data()};
}

bool finiteAt(const Planes& planes, size_t i) {
  return isFinite(planes[0][i]) && isFinite(planes[1][i]) && isFinite(planes[2][i]);
}

Buffer<MixSample> samplesOf(const Planes& y, const Noise& noise, const Planes& a, const Planes& b, size_t pixels) {
  Buffer<MixSample> samples(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    MixSample& sample = samples[i] = {};
    if (!finiteAt(a, i) || !finiteAt(b, i)) continue;
    const bool says = noise.pixel[i] != PixelNoise::Unknown;
    sample.samples = says ? noise.samples[i] : 0;
    for (size_t c = 0; c < 3; ++c) {
      sample.mean[c] = 0.5f * (a[c][i] + b[c][i]);
      sample.difference[c] = a[c][i] - b[c][i];
      if (!says) continue;
      sample.residual[c] = y[c][i] - b[c][i];
      sample.variance[c] = noise.variance[c][i] * noise.samples[i];
    }
  }
  return samples;
}

}  // namespace

Image mixed(const Image& noisy, const Noise& noise, const Image& first, const Image& second, const MixParams& params) {
  const int width = noisy.dataWindow.width(), height = noisy.dataWindow.height();
  const Planes y = coloursOf(noisy), a = coloursOf(first), b = coloursOf(second);
  const Buffer<MixSample> samples = samplesOf(y, noise, a, b, noisy.dataWindow.area());
  Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  std::array<float*, 3> out;
  for (const char* name : kRgbNames) result.add(name);
  for (size_t c = 0; c < 3; ++c) out[c] = result.planes[c].values.data();
  const float floor = kAlikeFloor * noise.level * noise.level;
  const Reach reach;
  parallelFor(0, height, [&](int row) {
    MixNeighbours neighbours;
    for (int x = 0; x < width; ++x) {
      const size_t i = size_t(row) * size_t(width) + size_t(x);
      if (!finiteAt(a, i) || !finiteAt(b, i)) {
        for (size_t c = 0; c < 3; ++c) out[c][i] = finiteAt(a, i) ? a[c][i] : b[c][i];
        continue;
      }
      neighbours.count = 0;
      forNeighbours(width, height, x, row, [&](int xq, int yq) {
        const MixSample& from = samples[size_t(yq) * size_t(width) + size_t(xq)];
        if (from.samples > 0) neighbours.add(from, reach(xq - x, yq - row));
      });
      const float share = mixShare(samples[i], neighbours, params, floor);
      for (size_t c = 0; c < 3; ++c) out[c][i] = b[c][i] + share * (a[c][i] - b[c][i]);
    }
  });
  return result;
}

}  // namespace fathom::flat
