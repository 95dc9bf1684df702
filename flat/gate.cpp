#include "flat/gate.h"

#include <array>

#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/gate_kernel.h"
#include "flat/neighbourhood.h"

namespace fathom::flat {

namespace {

Buffer<GateSample> samplesOf(const Image& noisy, const Noise& noise, const Image& denoised) {
  Buffer<GateSample> samples(noisy.dataWindow.area());
  std::array<const float*, 3> y, f;
  for (size_t c = 0; c < 3; ++c) {
    y[c] = noisy.get(kRgbNames[c]).values.data();
    f[c] = denoised.get(kRgbNames[c]).values.data();
  }
  for (size_t i = 0; i < samples.size(); ++i) {
    GateSample& sample = samples[i] = {};
    bool says = noise.pixel[i] != PixelNoise::Unknown;
    for (size_t c = 0; c < 3; ++c) says = says && isFinite(f[c][i]);
    if (!says) continue;
    sample.samples = noise.samples[i];
    for (size_t c = 0; c < 3; ++c) {
      sample.filtered[c] = f[c][i];
      sample.residual[c] = y[c][i] - f[c][i];
      sample.variance[c] = noise.variance[c][i] * noise.samples[i];
    }
  }
  return samples;
}

// f + k (y - f).
void takeBack(const Buffer<float>& k, const Buffer<float>& y, Buffer<float>& f) {
  for (size_t i = 0; i < f.size(); ++i)
    if (k[i] > 0 && isFinite(y[i])) f[i] += k[i] * (y[i] - f[i]);
}

}  // namespace

Buffer<float> gate(const Image& noisy, const Noise& noise, const Image& denoised, const GateParams& params) {
  const int width = noisy.dataWindow.width(), height = noisy.dataWindow.height();
  const Buffer<GateSample> samples = samplesOf(noisy, noise, denoised);
  Buffer<float> result(samples.size(), 0.0f);
  const float floor = kAlikeFloor * noise.level * noise.level;
  const Reach reach;
  parallelFor(0, height, [&](int y) {
    GateNeighbours neighbours;
    for (int x = 0; x < width; ++x) {
      const size_t i = size_t(y) * size_t(width) + size_t(x);
      if (!(samples[i].samples > 0)) continue;
      neighbours.count = 0;
      forNeighbours(width, height, x, y, [&](int xq, int yq) {
        neighbours.add(samples[size_t(yq) * size_t(width) + size_t(xq)], reach(xq - x, yq - y));
      });
      result[i] = takenBack(samples[i], neighbours, params.threshold, floor).k;
    }
  });
  return result;
}

Image gated(const Image& noisy, const Noise& noise, const Image& denoised, const GateParams& params) {
  const Buffer<float> k = gate(noisy, noise, denoised, params);
  Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  for (const char* name : kRgbNames) {
    Buffer<float>& values = result.add(name).values;
    values = denoised.get(name).values.copy();
    takeBack(k, noisy.get(name).values, values);
  }
  return result;
}

Denoiser withGate(Denoiser denoiser, const GateParams& params) {
  return [denoiser = std::move(denoiser), params](const Image& noisy, const Progress& progress) {
    Image result = denoiser(noisy, progress);
    if (!tellsNoise(noisy)) return result;
    const Buffer<float> k = gate(noisy, noiseOf(noisy), result, params);
    for (Plane& plane : result.planes)
      if (const Plane* y = noisy.find(plane.name)) takeBack(k, y->values, plane.values);
    return result;
  };
}

}  // namespace fathom::flat
