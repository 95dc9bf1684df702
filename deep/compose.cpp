#include "deep/compose.h"

#include <cmath>

#include "base/parallel.h"
#include "deep/bin_neighbours.h"
#include "deep/still.h"

namespace fathom::deep {

namespace {

constexpr std::array<const char*, 3> kRgb{"R", "G", "B"};

// The variance of one camera sample in a bin: from the file, else from the halves, else the pixel's.
float sampleVariance(const DenoiseData& data, const std::array<std::span<const float>, 3>& variance,
                     std::span<const std::array<Buffer<float>, 3>> ofPixels, size_t pixel, size_t bin, size_t c) {
  if (!variance[c].empty())
    return variance[c][bin] > 0 && variance[c][bin] <= kLargest ? variance[c][bin] * data.count[bin] : 0;
  float sum = 0;
  for (size_t i = 0; i < data.components.size(); ++i) {
    const float* v = data.components[i].data.data() + 8 * bin;
    const float scale = data.components[i].perAlbedo ? data.albedo.value[c][bin] + kAlbedoOffset : 1;
    if (!ofPixels.empty()) sum += scale * scale * ofPixels[i][c][pixel];
    if (!(v[3] > 0) || !(v[7] > 0)) continue;
    const float e = scale * (v[c] / v[3] - v[4 + c] / v[7]);
    const float share = v[3] / (v[3] + v[7]);
    sum += share * (1 - share) * e * e * data.count[bin];
  }
  return sum;
}

}  // namespace

std::vector<std::array<Buffer<float>, 3>> pixelVariance(const DenoiseData& data, std::span<const ComponentGuide> guides,
                                                        const DenoiseInputs& inputs) {
  std::vector<std::array<Buffer<float>, 3>> result;
  if (inputs.halves || inputs.variance) return result;
  const size_t width = size_t(data.width);
  for (const ComponentGuide& guide : guides) {
    auto& planes = result.emplace_back();
    for (Buffer<float>& plane : planes) plane = Buffer<float>(width * size_t(data.height));
    parallelFor(0, data.height, [&](int y) {
      for (size_t x = 0; x < width; ++x) {
        const size_t pixel = size_t(y) * width + x;
        float scale = 0;
        for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b)
          if (data.count[b] > 0) scale += data.weight[b] * data.weight[b] / data.count[b];
        for (size_t c = 0; c < 3; ++c)
          planes[c][pixel] = scale > 0 ? std::min(guide.variance.value[c].row(y)[x] / scale, kLargest) : 0;
      }
    });
  }
  return result;
}

Buffer<GateBin> compose(const DeepImage& image, const DenoiseData& data, const DenoiseInputs& inputs,
                        const Buffer<uint8_t>& still, std::span<const std::array<Buffer<float>, 3>> ofPixels,
                        std::span<Buffer<float>> filtered) {
  Buffer<GateBin> bins(data.bins());
  const Buffer<uint8_t> unread = allWithin(still, data.width, data.height, kGateRadius);
  const std::span<const float> alpha = image.get("A");
  const std::array<std::span<const float>, 3> noisy{image.get("R"), image.get("G"), image.get("B")};
  std::array<std::span<const float>, 3> variance;
  if (inputs.variance) variance = {image.get("variance.R"), image.get("variance.G"), image.get("variance.B")};
  const size_t width = size_t(data.width);
  parallelFor(0, data.height, [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel) {
      for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
        if (unread[pixel]) continue;
        GateBin& bin = bins[b] = {};
        const float inverse = alpha[b] > 0 ? 1 / std::min(alpha[b], 1.0f) : 0;
        bool finite = true;
        for (size_t c = 0; c < 3; ++c) {
          float sum = 0;
          for (size_t i = 0; i < data.components.size() && !still[pixel]; ++i) {
            float& v = filtered[i][3 * b + c];
            if (data.components[i].perAlbedo) v *= data.albedo.value[c][b] + kAlbedoOffset;
            sum += v;
          }
          const float y0 = noisy[c][b] * inverse;
          finite = finite && isFinite(y0);
          bin.filtered[c] = still[pixel] ? y0 : sum;
          bin.residual[c] = y0 - bin.filtered[c];
          bin.variance[c] = sampleVariance(data, variance, ofPixels, pixel, b, c);
          // One camera sample alone has no variance; how far it is from what was made of it is one sample of that.
          if (data.count[b] <= 1 && !(bin.variance[c] > 0) && finite)
            bin.variance[c] = bin.residual[c] * bin.residual[c];
        }
        bin.samples = data.weight[b] > 0 && finite ? data.count[b] : 0;
        if (!finite) std::fill_n(bin.residual, 3, 0.0f);
      }
    }
  });
  return bins;
}

Buffer<float> gatedColours(const DenoiseData& data, const Buffer<GateBin>& bins, const Buffer<flat::GateVerdict>& gates,
                           const Buffer<uint8_t>& still) {
  Buffer<float> colours(data.bins() * 3, 0.0f);  // of pixels that nothing is made from, too
  const Buffer<uint8_t> unread = allWithin(still, data.width, data.height, kGateRadius);
  forActiveBins(data, unread, [&](int) {
    return [&](int, size_t b) {
      for (size_t c = 0; c < 3; ++c) colours[3 * b + c] = bins[b].filtered[c] + gates[b].k * bins[b].residual[c];
    };
  });
  return colours;
}

void writeColours(DeepImage& image, const DenoiseData& data, const Buffer<uint8_t>& still,
                  std::span<const Buffer<float>> filtered, const Buffer<flat::GateVerdict>& gates,
                  const Buffer<float>& colours) {
  const std::span<const float> alpha = image.get("A");
  const size_t width = size_t(data.width);
  for (size_t c = 0; c < 3; ++c) {
    const std::span<float> whole = image.get(kRgb[c]);
    std::vector<std::span<float>> part;
    for (const DenoiseComponent& component : data.components)
      part.push_back(component.name.empty() ? whole : image.get(component.name + "." + kRgb[c]));
    parallelFor(0, data.height, [&](int y) {
      for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel) {
        for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
          if (!(data.weight[b] > 0)) {
            for (std::span<float>& values : part)
              if (!isFinite(values[b])) values[b] = 0;
            if (!isFinite(whole[b])) whole[b] = 0;
            continue;
          }
          if (still[pixel]) continue;
          const float a = std::min(alpha[b], 1.0f), k = gates[b].k;
          float sum = 0, light = 0;
          for (size_t i = 0; i < part.size(); ++i) {
            const float f = filtered[i][3 * b + c] * a;
            float& value = part[i][b];
            value = k > 0 && isFinite(value) ? f + k * (value - f) : f;
            sum += value;
            light += std::fabs(value);
          }
          if (!colours.empty()) {
            const float change = colours[3 * b + c] * a - sum;
            for (std::span<float>& values : part)
              values[b] += change * (light > 0 ? std::fabs(values[b]) / light : 1 / float(part.size()));
            sum += change;
          }
          whole[b] = sum;
        }
      }
    });
  }
}

}  // namespace fathom::deep
