// A flat render with Gaussian noise of known variance, its truth, and simple denoisers, for tests.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "flat/denoiser.h"
#include "flat/noise.h"

namespace fathom::reference {

struct NoisyFlat {
  flat::Image noisy, truth;
};

// A smooth shade with noise of standard deviation `noise`, the same for R, G and B up to their scale; components in equal
// parts and half buffers of `n0` and `n1` camera samples.
inline NoisyFlat makeNoisyFlat(int width, int height, unsigned seed, float noise = 0.1f, int n0 = 8, int n1 = 8) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  const Box window{-3, 2, -3 + width, 2 + height};
  NoisyFlat frame{{window, window, {}, {}}, {window, window, {}, {}}};
  const size_t pixels = window.area();
  const float n = float(n0 + n1);
  Buffer<float> e0(pixels), e1(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    e0[i] = normal(random) * std::sqrt(n / float(n0));
    e1[i] = normal(random) * std::sqrt(n / float(n1));
  }
  for (size_t c = 0; c < 3; ++c) {
    const std::string name = flat::kRgbNames[c];
    const float scale = 1 - 0.2f * float(c);
    Buffer<float>& truth = frame.truth.add(name).values;
    frame.noisy.add("variance." + name, noise * noise * scale * scale);
    for (const std::string half : {"", "half0.", "half1."}) {
      Buffer<float> whole(pixels);
      for (size_t i = 0; i < pixels; ++i) {
        const size_t row = i / size_t(width);
        const float x = float(i % size_t(width)), y = float(row);
        truth[i] = scale * (0.6f + 0.3f * std::sin(0.2f * x) * std::cos(0.15f * y));
        const float mean = (float(n0) * e0[i] + float(n1) * e1[i]) / n;
        whole[i] = truth[i] + scale * noise * (half.empty() ? mean : half == "half0." ? e0[i] : e1[i]);
      }
      for (const std::string part : {"diffuse.", "specular."}) {
        Buffer<float>& values = frame.noisy.add(fmt::format("{}{}{}", half, part, name)).values;
        for (size_t i = 0; i < pixels; ++i) values[i] = 0.5f * whole[i];
      }
      frame.noisy.add(half + name).values = std::move(whole);
    }
  }
  frame.noisy.add("half0.samples", float(n0));
  frame.noisy.add("half1.samples", float(n1));
  frame.noisy.attributes["fathom:spp"] = std::to_string(n0 + n1);
  return frame;
}

// The mean of 3x3 pixels, fewer at the border: linear, its own pixel counts 1 / (number of pixels).
inline flat::Image boxMean(const flat::Image& noisy) {
  flat::Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  const int width = noisy.dataWindow.width(), height = noisy.dataWindow.height();
  for (const char* name : flat::kRgbNames) {
    const Buffer<float>& in = noisy.get(name).values;
    Buffer<float>& out = result.add(name).values;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        float sum = 0, count = 0;
        for (int yq = std::max(0, y - 1); yq <= std::min(height - 1, y + 1); ++yq)
          for (int xq = std::max(0, x - 1); xq <= std::min(width - 1, x + 1); ++xq) {
            sum += in[size_t(yq * width + xq)];
            ++count;
          }
        out[size_t(y * width + x)] = sum / count;
      }
  }
  return result;
}

inline flat::Denoiser boxDenoiser() {
  return [](const flat::Image& noisy, const Progress&) { return boxMean(noisy); };
}

// Not linear: a mean with weights by likeness of the colours.
inline flat::Denoiser rangeDenoiser(float width) {
  return [width](const flat::Image& noisy, const Progress&) {
    flat::Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
    const int w = noisy.dataWindow.width(), h = noisy.dataWindow.height();
    for (const char* name : flat::kRgbNames) {
      const Buffer<float>& in = noisy.get(name).values;
      Buffer<float>& out = result.add(name).values;
      for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) {
          float sum = 0, weights = 0;
          for (int yq = std::max(0, y - 2); yq <= std::min(h - 1, y + 2); ++yq)
            for (int xq = std::max(0, x - 2); xq <= std::min(w - 1, x + 2); ++xq) {
              const float e = (in[size_t(yq * w + xq)] - in[size_t(y * w + x)]) / width;
              const float weight = std::exp(-e * e);
              sum += weight * in[size_t(yq * w + xq)];
              weights += weight;
            }
          out[size_t(y * w + x)] = sum / weights;
        }
    }
    return result;
  };
}

}  // namespace fathom::reference
