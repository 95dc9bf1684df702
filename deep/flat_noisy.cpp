#include "deep/flat_noisy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "base/parallel.h"
#include "deep/alpha.h"
#include "deep/denoise_data.h"

namespace fathom::deep {

namespace {

constexpr int kRowsAtOnce = 8;

// What the sums over a pixel's bins need of each bin.
struct Shares {
  Buffer<float> transmittance;  // in front of it
  Buffer<float> alpha;          // its own, in [0,1]
  Buffer<float> count;          // camera samples
  Buffer<float> pixelCount;     // per pixel: its camera samples
};

template <class Body>
void forPixels(const DeepImage& image, const Body& body) {
  const size_t width = size_t(image.dataWindow.width());
  parallelRanges(0, image.dataWindow.height(), kRowsAtOnce, [&](int y0, int y1) {
    for (size_t pixel = size_t(y0) * width; pixel < size_t(y1) * width; ++pixel)
      body(pixel, size_t(image.offsets[pixel]), size_t(image.offsets[pixel + 1]));
  });
}

Shares sharesOf(const DeepImage& image, const DenoiseInputs& inputs) {
  const size_t bins = image.samples();
  Shares shares{Buffer<float>(bins), Buffer<float>(bins), Buffer<float>(bins), Buffer<float>(image.pixels())};
  const std::span<const float> alpha = image.get("A");
  const std::span<const float> samples = inputs.counts ? image.get("samples") : std::span<const float>();
  const float spp = float(inputs.spp > 0 ? inputs.spp : kAssumedSpp);
  forPixels(image, [&](size_t pixel, size_t begin, size_t end) {
    float passed = 1, seen = 0, count = 0;
    for (size_t b = begin; b < end; ++b) {
      const float a = alpha[b] > 0 ? std::min(alpha[b], 1.0f) : 0;
      shares.transmittance[b] = passed;
      shares.alpha[b] = a;
      const float n = samples.empty() ? passed * a * spp : samples[b];
      shares.count[b] = n > 0 && isFinite(n) ? n : 0;
      count += shares.count[b];
      seen += passed * a;
      passed *= 1 - a;
    }
    shares.pixelCount[pixel] = inputs.spp > 0 ? float(inputs.spp) : seen > 0 ? std::max(count / seen, 1.0f) : spp;
  });
  return shares;
}

// A channel that `over` composites; each bin counts `times` (per bin, or nothing: once).
void addComposited(const DeepImage& image, const std::string& name, const Shares& shares, const Buffer<float>* times,
                   flat::Image& result) {
  const std::span<const float> in = image.get(name);
  Buffer<float>& out = result.add(name).values;
  forPixels(image, [&](size_t pixel, size_t begin, size_t end) {
    double sum = 0;
    for (size_t b = begin; b < end; ++b)
      sum += double(shares.transmittance[b] * finiteOrZero(in[b])) * (times ? double((*times)[b]) : 1.0);
    out[pixel] = finiteOrZero(float(sum));
  });
}

// How often a half counts in each bin: 2 n_h / (n_0 + n_1).
Buffer<float> halfTimes(const DeepImage& image, const std::string& half) {
  const std::span<const float> n0 = image.get("half0.samples"), n1 = image.get("half1.samples"),
                               n = image.get(half + "samples");
  Buffer<float> times(n.size());
  for (size_t b = 0; b < n.size(); ++b) {
    const float all = std::max(n0[b], 0.0f) + std::max(n1[b], 0.0f);
    times[b] = all > 0 && isFinite(all) ? 2 * std::max(n[b], 0.0f) / all : 0;
  }
  return times;
}

// The variance of the pixels' means of a channel that has variances; `premultiplied`: its values are.
void addVariance(const DeepImage& image, const std::string& name, bool premultiplied, const Shares& shares,
                 flat::Image& result) {
  const std::span<const float> in = image.get(name), variance = image.get("variance." + name);
  Buffer<float>& out = result.add("variance." + name).values;
  forPixels(image, [&](size_t pixel, size_t begin, size_t end) {
    double seen = 0, mean = 0, square = 0;
    for (size_t b = begin; b < end; ++b) {
      const double w = double(shares.transmittance[b] * shares.alpha[b]);
      const double x = double(finiteOrZero(in[b])) / (premultiplied && w > 0 ? double(shares.alpha[b]) : 1.0);
      if (!(w > 0) || !(std::abs(x) <= double(kLargest))) continue;
      const double v = variance[b] > 0 ? double(finiteOrZero(variance[b])) : 0;
      seen += w;
      mean += w * x;
      square += w * (std::max(double(shares.count[b]) - 1, 0.0) * v + x * x);
    }
    // A depth is known of what is seen alone.
    const double whole = premultiplied ? 1 : seen;
    const double count = double(shares.pixelCount[pixel]) * whole;
    const double spread = whole > 0 ? square / whole - mean / whole * (mean / whole) : 0;
    out[pixel] = count > 1 && spread > 0 ? finiteOrZero(float(spread / (count - 1))) : 0;
  });
}

void addDepth(const DeepImage& image, const Shares& shares, flat::Image& result) {
  const std::span<const float> z = image.get("Z");
  // Values stay where they are when planes are added; planes do not.
  float *const out = result.add("Z").values.data(), *const alpha = result.add("A").values.data();
  forPixels(image, [&](size_t pixel, size_t begin, size_t end) {
    double seen = 0, sum = 0;
    for (size_t b = begin; b < end; ++b) {
      const double w = double(shares.transmittance[b] * shares.alpha[b]);
      seen += w;
      sum += w * double(finiteOrZero(z[b]));
    }
    out[pixel] = seen > 0 ? float(sum / seen) : 0;
    alpha[pixel] = float(seen);
  });
}

using Names = std::vector<std::string>;

Names withGroup(const std::string& group, const char* suffixes) {
  Names names;
  for (const char* s = suffixes; *s; ++s) names.push_back(group + *s);
  return names;
}

void append(Names& names, const Names& more) {
  names.insert(names.end(), more.begin(), more.end());
}

}  // namespace

flat::Image flattenNoisy(const DeepImage& image, const DenoiseInputs& inputs) {
  flat::Image result{image.dataWindow, image.displayWindow, {}, {}};
  const Shares shares = sharesOf(image, inputs);
  Names colours = inputs.components ? withGroup("diffuse.", "RGB") : withGroup("", "RGB"), composited, varying;
  if (inputs.components) append(colours, withGroup("specular.", "RGB"));
  composited = inputs.components ? withGroup("", "RGB") : Names();
  append(composited, colours);
  if (inputs.albedo) append(composited, withGroup("albedo.", "RGB"));
  if (inputs.normal) append(composited, withGroup("N.", "XYZ"));
  for (const std::string& name : composited) addComposited(image, name, shares, nullptr, result);
  addDepth(image, shares, result);
  if (inputs.variance) append(varying, withGroup("", "RGB"));
  if (inputs.albedoVariance) append(varying, withGroup("albedo.", "RGB"));
  if (inputs.normalVariance) append(varying, withGroup("N.", "XYZ"));
  for (const std::string& name : varying) addVariance(image, name, true, shares, result);
  if (inputs.depthVariance) addVariance(image, "Z", false, shares, result);
  for (const std::string half : {"half0.", "half1."}) {
    if (!inputs.halves) continue;
    const Buffer<float> times = inputs.halfCounts ? halfTimes(image, half) : Buffer<float>();
    Names names = colours;
    if (inputs.albedoHalves) append(names, withGroup("albedo.", "RGB"));
    for (const std::string& name : names)
      addComposited(image, half + name, shares, times.empty() ? nullptr : &times, result);
  }
  std::copy_n(shares.pixelCount.data(), shares.pixelCount.size(), result.add("samples").values.data());
  return result;
}

}  // namespace fathom::deep
