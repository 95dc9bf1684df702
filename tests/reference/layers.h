// Plain layers in double precision, one loop after another.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/reference/safetensors.h"

namespace fathom::reference {

// [channels][height][width].
struct Volume {
  int channels = 0, height = 0, width = 0;
  std::vector<double> values;

  Volume() = default;
  Volume(int c, int h, int w) : channels(c), height(h), width(w), values(size_t(c) * size_t(h) * size_t(w)) {}
  double& at(int c, int y, int x) {
    return values[(size_t(c) * size_t(height) + size_t(y)) * size_t(width) + size_t(x)];
  }
  double at(int c, int y, int x) const { return const_cast<Volume*>(this)->at(c, y, x); }
  double clamped(int c, int y, int x) const { return at(c, std::clamp(y, 0, height - 1), std::clamp(x, 0, width - 1)); }
};

template <class Function>
Volume mapped(Volume v, const Function& function) {
  for (double& value : v.values) value = function(value);
  return v;
}

inline Volume relu(Volume v) {
  return mapped(std::move(v), [](double x) { return std::max(x, 0.0); });
}
inline Volume sigmoid(Volume v) {
  return mapped(std::move(v), [](double x) { return 1 / (1 + std::exp(-x)); });
}

inline Volume plus(Volume a, const Volume& b) {
  for (size_t i = 0; i < a.values.size(); ++i) a.values[i] += b.values[i];
  return a;
}

// Draws the weights of one convolution after another, so that values stay about as large.
class RandomConvolutions {
 public:
  RandomConvolutions(PlainWeights& weights, uint32_t seed) : weights_(weights), generator_(seed) {}

  void operator()(const std::string& name, int from, int to, int kernel, bool bias = true) {
    draw(name + ".weight", {to, from, kernel, kernel}, std::sqrt(4.0 / (from * kernel * kernel)));
    if (bias) draw(name + ".bias", {to}, 0.1);
  }

 private:
  void draw(const std::string& name, std::vector<int64_t> shape, double scale) {
    PlainTensor& made = weights_.tensors[name];
    int64_t count = 1;
    for (const int64_t n : shape) count *= n;
    made.shape = std::move(shape);
    for (int64_t i = 0; i < count; ++i)
      made.values.push_back(float(scale * (2.0 * double(generator_()) / 4294967296.0 - 1)));
  }

  PlainWeights& weights_;
  std::mt19937 generator_;
};

inline Volume convolve(const PlainWeights& weights, const std::string& name, const Volume& in, int stride = 1) {
  const PlainTensor& weight = weights.tensors.at(name + ".weight");
  const auto bias = weights.tensors.find(name + ".bias");
  const int outputs = int(weight.shape[0]), kernel = int(weight.shape[2]), pad = kernel == 3 ? 1 : 0;
  Volume out(outputs, (in.height + 2 * pad - kernel) / stride + 1, (in.width + 2 * pad - kernel) / stride + 1);
  for (int o = 0; o < outputs; ++o)
    for (int y = 0; y < out.height; ++y)
      for (int x = 0; x < out.width; ++x) {
        double sum = bias == weights.tensors.end() ? 0 : double(bias->second.values[size_t(o)]);
        for (int i = 0; i < in.channels; ++i)
          for (int ky = 0; ky < kernel; ++ky)
            for (int kx = 0; kx < kernel; ++kx) {
              const int sy = y * stride + ky - pad, sx = x * stride + kx - pad;
              if (sy < 0 || sx < 0 || sy >= in.height || sx >= in.width) continue;
              sum +=
                  double(weight.values[size_t(((o * in.channels + i) * kernel + ky) * kernel + kx)]) * in.at(i, sy, sx);
            }
        out.at(o, y, x) = sum;
      }
  return out;
}

inline Volume upsample(const Volume& in) {
  Volume out(in.channels, 2 * in.height, 2 * in.width);
  for (int c = 0; c < out.channels; ++c)
    for (int y = 0; y < out.height; ++y)
      for (int x = 0; x < out.width; ++x) out.at(c, y, x) = in.at(c, y / 2, x / 2);
  return out;
}

inline Volume concat(const Volume& a, const Volume& b) {
  Volume out(a.channels + b.channels, a.height, a.width);
  std::copy(b.values.begin(), b.values.end(), std::copy(a.values.begin(), a.values.end(), out.values.begin()));
  return out;
}

// Softmax of the first 25 channels, then the weighted sum of 5x5 pixels, the outermost ones repeated.
inline Volume filterColour(const Volume& logits, const Volume& colour) {
  Volume out(3, colour.height, colour.width);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      double most = -1e300, total = 0;
      for (int k = 0; k < 25; ++k) most = std::max(most, logits.at(k, y, x));
      for (int k = 0; k < 25; ++k) {
        const double weight = std::exp(logits.at(k, y, x) - most);
        total += weight;
        for (int c = 0; c < 3; ++c) out.at(c, y, x) += weight * colour.clamped(c, y + k / 5 - 2, x + k % 5 - 2);
      }
      for (int c = 0; c < 3; ++c) out.at(c, y, x) /= total;
    }
  return out;
}

inline Volume halve(const Volume& in) {
  Volume out(in.channels, in.height / 2, in.width / 2);
  for (int c = 0; c < out.channels; ++c)
    for (int y = 0; y < out.height; ++y)
      for (int x = 0; x < out.width; ++x)
        for (int k = 0; k < 4; ++k) out.at(c, y, x) += in.at(c, 2 * y + k / 2, 2 * x + k % 2) / 4;
  return out;
}

// Bilinear, with pixel centres at halves.
inline Volume enlarge(const Volume& in) {
  Volume out(in.channels, 2 * in.height, 2 * in.width);
  for (int c = 0; c < out.channels; ++c)
    for (int y = 0; y < out.height; ++y)
      for (int x = 0; x < out.width; ++x) {
        const double sy = (y + 0.5) / 2 - 0.5, sx = (x + 0.5) / 2 - 0.5;
        const int y0 = int(std::floor(sy)), x0 = int(std::floor(sx));
        const double fy = sy - y0, fx = sx - x0;
        out.at(c, y, x) = (1 - fy) * ((1 - fx) * in.clamped(c, y0, x0) + fx * in.clamped(c, y0, x0 + 1)) +
                          fy * ((1 - fx) * in.clamped(c, y0 + 1, x0) + fx * in.clamped(c, y0 + 1, x0 + 1));
      }
  return out;
}

// fine + alpha * U(coarse - D(fine)); alpha is one channel.
inline Volume addCoarse(const Volume& fine, const Volume& alpha, const Volume& coarse) {
  Volume difference = halve(fine);
  for (size_t i = 0; i < difference.values.size(); ++i) difference.values[i] = coarse.values[i] - difference.values[i];
  const Volume up = enlarge(difference);
  Volume out = fine;
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < fine.height; ++y)
      for (int x = 0; x < fine.width; ++x) out.at(c, y, x) += alpha.at(0, y, x) * up.at(c, y, x);
  return out;
}

inline Volume channel(const Volume& in, int c) {
  Volume out(1, in.height, in.width);
  std::copy_n(in.values.begin() + ptrdiff_t(c) * ptrdiff_t(out.values.size()), out.values.size(), out.values.begin());
  return out;
}

// Uniform in [low, high), and a float each.
inline Volume randomVolume(int channels, int height, int width, uint32_t seed, double low, double high) {
  std::mt19937 generator(seed);
  Volume out(channels, height, width);
  for (double& v : out.values) v = double(float(low + (high - low) * double(generator()) / 4294967296.0));
  return out;
}

inline std::vector<float> floatsOf(const Volume& v) {
  return {v.values.begin(), v.values.end()};
}

// Splatted and normalised, 5 channels: sums by source pixels, where the kernel gathers by result pixels.
inline Volume splatted(const Volume& logits, const Volume& values) {
  Volume sum(values.channels, values.height, values.width), out(values.channels - 1, values.height, values.width);
  for (int y = 0; y < values.height; ++y)
    for (int x = 0; x < values.width; ++x)
      for (int k = 0; k < 25; ++k) {
        const int ty = y + k / 5 - 2, tx = x + k % 5 - 2;
        if (ty < 0 || tx < 0 || ty >= values.height || tx >= values.width) continue;
        const double weight = std::exp(std::clamp(logits.at(k, y, x), -12.0, 12.0));
        for (int c = 0; c < values.channels; ++c) sum.at(c, ty, tx) += weight * values.at(c, y, x);
      }
  for (int i = 0; i < values.height * values.width; ++i) {
    const int y = i / values.width, x = i % values.width;
    const double n = sum.at(4, y, x) + 1e-12;
    for (int c = 0; c < 3; ++c) out.at(c, y, x) = sum.at(c, y, x) / n;
    out.at(3, y, x) = std::min(1.0, sum.at(3, y, x) / n);
    for (int c = 5; c < values.channels; ++c) out.at(c - 1, y, x) = sum.at(c, y, x) / n;
  }
  return out;
}

// The tensors NAME.weight and NAME.bias of a convolution.
inline void addConv(PlainWeights& weights, const std::string& name, int from, int to, int kernel, uint32_t seed) {
  const Volume values = randomVolume(to * from, kernel, kernel, seed, -0.3, 0.3);
  weights.tensors[name + ".weight"] = {{to, from, kernel, kernel}, floatsOf(values)};
  weights.tensors[name + ".bias"] = {{to}, floatsOf(randomVolume(1, 1, to, seed + 1, -0.5, 0.5))};
}

}  // namespace fathom::reference
