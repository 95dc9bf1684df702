#include "deep/consistency.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/mix.h"

namespace fathom::deep {

namespace {

template <class Body>
void forPixels(const DenoiseData& data, const Body& body) {
  const size_t width = size_t(data.width);
  parallelFor(0, data.height, [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < (size_t(y) + 1) * width; ++pixel)
      body(pixel, size_t(data.offsets[pixel]), size_t(data.offsets[pixel + 1]));
  });
}

// The frame that bins of these colours come to, with the light of bins that have no say.
flat::Image flattened(const DeepImage& image, const DenoiseData& data, const Buffer<float>& colours) {
  flat::Image result{image.dataWindow, image.displayWindow, {}, {}};
  const std::span<const float> alpha = image.get("A");
  for (size_t c = 0; c < 3; ++c) {
    const std::span<const float> in = image.get(flat::kRgbNames[c]);
    Buffer<float>& out = result.add(flat::kRgbNames[c]).values;
    forPixels(data, [&](size_t pixel, size_t begin, size_t end) {
      float passed = 1, sum = 0;
      for (size_t b = begin; b < end; ++b) {
        sum += data.weight[b] > 0 ? data.weight[b] * colours[3 * b + c] : passed * finiteOrZero(in[b]);
        passed *= 1 - std::clamp(alpha[b], 0.0f, 1.0f);
      }
      out[pixel] = sum;
    });
  }
  return result;
}

// The expected squared error of a bin's colour; `least` where that is nothing.
float errorOf(const flat::GateVerdict& gate, size_t c, float colour, const ConsistencyParams& params, float least) {
  const float left = 1 - gate.k;
  return params.relative * colour * colour + params.noise * gate.noise[c] + left * left * gate.bias2[c] + least;
}

struct Pixel {
  size_t begin, end;
  float samples;  // camera samples
};

// One channel of one pixel.
void moveBins(const DenoiseData& data, const Pixel& pixel, size_t c, float target, float now,
              const Buffer<flat::GateVerdict>& gates, const ConsistencyParams& params, float least,
              Buffer<float>& colours) {
  float square = 0, mean = 0, error = 0;
  for (size_t b = pixel.begin; b < pixel.end; ++b) {
    const float w = data.weight[b], value = colours[3 * b + c];
    mean += w * value;
    square += w * value * value;
    error += w * w * errorOf(gates[b], c, value, params, least);
  }
  const float alphaNoise = std::max(0.0f, square - mean * mean) / std::max(pixel.samples, 1.0f);
  const float pull = (target - now) / (error + params.alphaNoise * alphaNoise);
  if (!(error > 0) || !std::isfinite(error) || !isFinite(pull)) return;  // squares may be too many to tell
  for (size_t b = pixel.begin; b < pixel.end; ++b) {
    if (!(data.weight[b] > 0)) continue;
    float& value = colours[3 * b + c];
    const float v = errorOf(gates[b], c, value, params, least);
    const float most = params.mostDeviations * std::sqrt(v);
    const float moved = value + std::clamp(v * data.weight[b] * pull, -most, most);
    value = std::max(moved, std::min(value, 0.0f));
  }
}

}  // namespace

void makeConsistent(const DeepImage& image, const DenoiseData& data, const BaseGuide& guide,
                    const Buffer<flat::GateVerdict>& gates, const Buffer<uint8_t>& still, float level,
                    Buffer<float>& colours) {
  const ConsistencyParams& params = guide.consistency;
  flat::Noise noise = flat::noiseOf(guide.noisy);
  noise.level = level;
  const flat::Image now = flattened(image, data, colours);
  const flat::Image target = flat::mixed(guide.noisy, noise, now, guide.flattened, params.mix);
  const float least = 4e-6f * level * level;
  forPixels(data, [&](size_t pixel, size_t begin, size_t end) {
    for (size_t c = 0; c < 3 && !still[pixel]; ++c)
      moveBins(data, {begin, end, noise.samples[pixel]}, c, target.planes[c].values[pixel], now.planes[c].values[pixel],
               gates, params, least, colours);
  });
}

}  // namespace fathom::deep
