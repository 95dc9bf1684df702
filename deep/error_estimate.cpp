#include "deep/error_estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/alpha.h"
#include "deep/flat_noisy.h"
#include "flat/error_map.h"
#include "flat/finite.h"
#include "flat/perturb.h"

namespace fathom::deep {

namespace {

using Planes = std::array<Buffer<float>, 3>;

bool isMoved(const std::string& name) {
  for (const std::string half : {"", "half0.", "half1."})
    for (const std::string group : {"", "diffuse.", "specular.", "albedo."})
      for (const char* rgb : flat::kRgbNames)
        if (name == half + group + rgb) return true;
  return false;
}

// The bins as a row of pixels, with what flat/perturb and flat/noise read of them; not premultiplied.
flat::Image rowOfBins(const DeepImage& image, const DenoiseInputs& inputs) {
  const Box box{0, 0, int(image.samples()), 1};
  flat::Image row{box, box, {}, {}};
  const std::span<const float> alpha = image.get("A");
  for (const Channel& channel : image.channels) {
    if (channel.type == PixelType::Uint) continue;
    const bool colour = isMoved(channel.name);
    const bool statistic = channel.name.starts_with("variance.") || channel.name.ends_with("samples");
    if (!colour && !statistic) continue;
    Buffer<float>& values = row.add(channel.name).values;
    for (size_t b = 0; b < values.size(); ++b)
      values[b] = colour ? (alpha[b] > 0 ? channel.values[b] / std::min(alpha[b], 1.0f) : 0) : channel.values[b];
  }
  if (inputs.spp > 0) row.attributes["fathom:spp"] = std::to_string(inputs.spp);
  return row;
}

// The image with the colours of such a row.
DeepImage withRow(const DeepImage& image, const flat::Image& row) {
  DeepImage result = image.copy();
  const std::span<const float> alpha = image.get("A");
  for (Channel& channel : result.channels) {
    const flat::Plane* plane = isMoved(channel.name) ? row.find(channel.name) : nullptr;
    for (size_t b = 0; plane && b < plane->values.size(); ++b)
      if (alpha[b] > 0) channel.values[b] = plane->values[b] * std::min(alpha[b], 1.0f);
  }
  return result;
}

// Calls body(pixel, begin, end) with the bins of each pixel.
template <class Body>
void forPixels(const DeepImage& image, const Body& body) {
  const size_t width = size_t(image.dataWindow.width());
  parallelFor(0, image.dataWindow.height(), [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < (size_t(y) + 1) * width; ++pixel)
      body(pixel, size_t(image.offsets[pixel]), size_t(image.offsets[pixel + 1]));
  });
}

// What body(begin, end) makes of the bins of each pixel.
template <class Body>
Buffer<float> sums(const DeepImage& image, const Body& body) {
  Buffer<float> result(image.pixels());
  forPixels(image, [&](size_t pixel, size_t begin, size_t end) { result[pixel] = float(body(begin, end)); });
  return result;
}

// What the bins of a channel add to their pixels: weight times colour.
Buffer<float> seen(const DeepImage& image, const Buffer<float>& weight, const std::string& name) {
  const std::span<const float> values = image.get(name), alpha = image.get("A");
  return sums(image, [&](size_t begin, size_t end) {
    double sum = 0;
    for (size_t b = begin; b < end; ++b)
      if (alpha[b] > 0) sum += double(weight[b]) * double(finiteOrZero(values[b] / std::min(alpha[b], 1.0f)));
    return sum;
  });
}

// Of the alphas' noise: N times the covariance that it gives two images of the same bins.
Buffer<float> alphaCovariance(const DeepImage& first, const DeepImage& second, const Buffer<float>& weight,
                              const std::string& name) {
  const std::span<const float> x = first.get(name), y = second.get(name), alpha = first.get("A");
  return sums(first, [&](size_t begin, size_t end) {
    double both = 0, ofX = 0, ofY = 0;
    for (size_t i = begin; i < end; ++i) {
      if (!(alpha[i] > 0)) continue;
      const float a = std::min(alpha[i], 1.0f);
      const double w = double(weight[i]), p = double(finiteOrZero(x[i] / a)), q = double(finiteOrZero(y[i] / a));
      both += w * p * q;
      ofX += w * p;
      ofY += w * q;
    }
    return both - ofX * ofY;
  });
}

// Nothing estimated yet, for so many pixels.
flat::ErrorEstimate emptyEstimate(size_t pixels) {
  flat::ErrorEstimate estimate;
  for (Planes* planes : {&estimate.error, &estimate.covariance, &estimate.spread})
    for (Buffer<float>& plane : *planes) plane = Buffer<float>(pixels, 0.0f);
  return estimate;
}

// A probe's part of the estimate: how the result moves with the colours' noise.
void addProbe(const DeepImage& noisy, const DeepImage& moved, const DeepImage& denoised, const DeepImage& after,
              const Buffer<float>& weight, const flat::SureParams& params, flat::ErrorEstimate& estimate) {
  for (size_t c = 0; c < 3; ++c) {
    const std::string name = flat::kRgbNames[c];
    const Buffer<float> y = seen(noisy, weight, name), yMoved = seen(moved, weight, name);
    const Buffer<float> f = seen(denoised, weight, name), fMoved = seen(after, weight, name);
    for (size_t i = 0; i < y.size(); ++i) {
      const float step = (yMoved[i] - y[i]) / params.size, answer = (fMoved[i] - f[i]) / params.size;
      estimate.covariance[c][i] += step * answer / float(params.probes);
      estimate.spread[c][i] += answer * answer / float(params.probes);
    }
  }
}

// The alphas' part, and then the error. Returns the flattened result.
flat::Image finish(const DeepImage& noisy, const DeepImage& denoised, const Buffer<float>& weight,
                   const flat::Noise& noise, flat::ErrorEstimate& estimate) {
  flat::Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  for (size_t c = 0; c < 3; ++c) {
    const std::string name = flat::kRgbNames[c];
    const Buffer<float> y = seen(noisy, weight, name), f = seen(denoised, weight, name);
    const Buffer<float> both = alphaCovariance(noisy, denoised, weight, name),
                        ofResult = alphaCovariance(denoised, denoised, weight, name);
    for (size_t i = 0; i < y.size(); ++i) {
      const float n = noise.samples[i], e = f[i] - y[i];
      estimate.covariance[c][i] += both[i] / n;
      estimate.spread[c][i] += std::max(ofResult[i], 0.0f) / n;
      estimate.error[c][i] = e * e - noise.variance[c][i] + 2 * estimate.covariance[c][i];
    }
    std::copy(f.begin(), f.end(), result.add(name).values.begin());
  }
  return result;
}

// A channel that flattens to the pixels' values.
void shareOut(const Buffer<float>& ofPixels, const Buffer<float>& weight, const std::string& name, DeepImage& image) {
  image.erase(name);
  Buffer<float>& values = image.add(name, PixelType::Float).values;
  const std::span<const float> alpha = std::as_const(image).get("A");
  forPixels(image, [&](size_t pixel, size_t begin, size_t end) {
    float covered = 0;
    for (size_t b = begin; b < end; ++b) covered += weight[b];
    for (size_t b = begin; b < end; ++b)
      values[b] = alpha[b] > 0 ? std::min(alpha[b], 1.0f) * ofPixels[pixel] / covered : 0;
  });
}

}  // namespace

void addFlattenedErrors(const DeepImage& noisy, const DenoiseInputs& inputs,
                        const std::function<DeepImage(DeepImage, const Progress&)>& denoiser,
                        const flat::SureParams& params, const Progress& progress, DeepImage& denoised) {
  const flat::Image flattened = flattenNoisy(noisy, inputs);
  const flat::Noise noise = flat::noiseOf(flattened);
  const Buffer<float> weight = effectiveAlpha(noisy);
  const flat::Image row = rowOfBins(noisy, inputs);
  const flat::Noise rowNoise = flat::noiseOf(row);
  const flat::Perturber perturber(row, rowNoise);
  flat::ErrorEstimate estimate = emptyEstimate(noisy.pixels());
  for (int k = 0; k < params.probes; ++k) {
    const Progress part{[&](double done) { progress.at((double(k) + done) / params.probes); }, progress.stop};
    const DeepImage moved = withRow(noisy, perturber.moved(params.seed, k, params.size));
    addProbe(noisy, moved, denoised, denoiser(moved.copy(), part), weight, params, estimate);
  }
  const flat::Image result = finish(noisy, denoised, weight, noise, estimate);
  const flat::ErrorMap map = flat::mapErrors(estimate, noise, result);
  for (size_t c = 0; c < 3; ++c) shareOut(map.error[c], weight, std::string("error.") + flat::kRgbNames[c], denoised);
}

}  // namespace fathom::deep
