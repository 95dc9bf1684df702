#include "deep/assemble.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "deep/alpha.h"
#include "deep/bin_layout.h"
#include "deep/channels.h"
#include "deep/volume.h"

namespace fathom::deep {

namespace {

Buffer<float> depths(const DeepImage& image) {
  const std::span<const float> z = image.get("Z"), back = image.tryGet("ZBack");
  Buffer<float> result(z.size());
  for (size_t i = 0; i < z.size(); ++i) result[i] = binDepth(z[i], back.empty() ? z[i] : back[i]);
  return result;
}

// Which samples of one image come to which bins of another, and with what weight.
class Pairing {
 public:
  Pairing(const DeepImage& to, const DeepImage& from)
      : to_(to), from_(from), weight_(effectiveAlpha(from)), bin_(from.samples()), nearestSample_(to.samples()) {
    const Buffer<float> toDepth = depths(to), fromDepth = depths(from);
    forEachPixel([&](size_t toFirst, size_t toCount, size_t fromFirst, size_t fromCount) {
      const std::span<const float> bins{toDepth.data() + toFirst, toCount};
      const std::span<const float> samples{fromDepth.data() + fromFirst, fromCount};
      if (!bins.empty())
        for (size_t i = 0; i < fromCount; ++i) bin_[fromFirst + i] = uint32_t(nearestBin(bins, samples[i]));
      if (!samples.empty())
        for (size_t b = 0; b < toCount; ++b) nearestSample_[toFirst + b] = uint32_t(nearestBin(samples, bins[b]));
    });
  }

  // Calls body(first bin, bins, first sample, samples) for every pixel that both images have, rows in parallel.
  template <class Body>
  void forEachPixel(const Body& body) const {
    const Box box = intersect(to_.dataWindow, from_.dataWindow);
    parallelFor(box.y0, std::max(box.y0, box.y1), [&](int y) {
      for (int x = box.x0; x < box.x1; ++x) {
        const size_t a = to_.dataWindow.index(x, y), b = from_.dataWindow.index(x, y);
        body(size_t(to_.offsets[a]), to_.count(a), size_t(from_.offsets[b]), from_.count(b));
      }
    });
  }

  // The sum over the samples that come to each bin of value(sample).
  template <class Value>
  Buffer<double> sum(const Value& value) const {
    Buffer<double> result(to_.samples(), 0);
    forEachPixel([&](size_t toFirst, size_t toCount, size_t fromFirst, size_t fromCount) {
      if (toCount == 0) return;
      for (size_t i = fromFirst; i < fromFirst + fromCount; ++i) result[toFirst + bin_[i]] += value(i);
    });
    return result;
  }

  double weight(size_t sample) const { return double(weight_[sample]); }

  // Calls body(bin, sample) for every bin of a pixel that has samples in `from`.
  template <class Body>
  void forEachNearest(const Body& body) const {
    forEachPixel([&](size_t toFirst, size_t toCount, size_t fromFirst, size_t fromCount) {
      if (fromCount == 0) return;
      for (size_t b = toFirst; b < toFirst + toCount; ++b) body(b, fromFirst + nearestSample_[b]);
    });
  }

 private:
  const DeepImage& to_;
  const DeepImage& from_;
  Buffer<float> weight_;            // effective alpha of `from`
  Buffer<uint32_t> bin_;            // per sample of `from`, the bin within its pixel
  Buffer<uint32_t> nearestSample_;  // per bin, the sample within its pixel
};

double perAlpha(float value, float alpha) {
  return opacity(alpha) > 0 ? double(value) / opacity(alpha) : 0;
}

std::vector<const Channel*> channelsWhere(const DeepImage& image, bool (*wanted)(std::string_view)) {
  std::vector<const Channel*> result;
  for (const Channel& channel : image.channels)
    if (channel.type != PixelType::Uint && wanted(channel.name)) result.push_back(&channel);
  return result;
}

// Means, weighted by effective alpha, of a premultiplied channel without its alpha.
void addMeans(DeepImage& image, const std::string& name, const Pairing& pairing, const Buffer<double>& weights,
              std::span<const float> values, std::span<const float> alphas, bool nearestWhereNone) {
  const Buffer<double> sums = pairing.sum(
      [&](size_t i) { return pairing.weight(i) > 0 ? pairing.weight(i) * perAlpha(values[i], alphas[i]) : 0; });
  const std::span<const float> alpha = image.get("A");
  Buffer<float>& result = image.add(name, PixelType::Float).values;
  for (size_t b = 0; b < result.size(); ++b)
    result[b] = weights[b] > 0 ? float(sums[b] / weights[b] * opacity(alpha[b])) : 0;
  if (!nearestWhereNone) return;
  pairing.forEachNearest([&](size_t b, size_t i) {
    if (!(weights[b] > 0)) result[b] = float(perAlpha(values[i], alphas[i]) * opacity(alpha[b]));
  });
}

// The variance of the mean that addMeans makes.
void addVariance(DeepImage& image, const std::string& name, const Pairing& pairing, const Buffer<double>& weights,
                 std::span<const float> values) {
  const Buffer<double> sums = pairing.sum(
      [&](size_t i) { return pairing.weight(i) > 0 ? pairing.weight(i) * pairing.weight(i) * double(values[i]) : 0; });
  Buffer<float>& result = image.add(name, PixelType::Float).values;
  for (size_t b = 0; b < result.size(); ++b)
    result[b] = weights[b] > 0 ? float(sums[b] / (weights[b] * weights[b])) : 0;
  pairing.forEachNearest([&](size_t b, size_t i) {
    if (!(weights[b] > 0)) result[b] = values[i];
  });
}

bool isColour(std::string_view name) {
  return name == "R" || name == "G" || name == "B" || name.starts_with("diffuse.") || name.starts_with("specular.") ||
         name.starts_with("albedo.");
}

}  // namespace

bool isFeature(std::string_view channel) {
  constexpr std::array<std::string_view, 6> kLayers = {
      "albedo.", "N.", "variance.albedo.", "variance.N.", "half0.albedo.", "half1.albedo."};
  return channel == "variance.Z" || std::any_of(kLayers.begin(), kLayers.end(),
                                                [&](std::string_view layer) { return channel.starts_with(layer); });
}

void addFeatures(DeepImage& image, const DeepImage& features) {
  const Pairing pairing(image, features);
  const Buffer<double> weights = pairing.sum([&](size_t i) { return pairing.weight(i); });
  for (const Channel* channel : channelsWhere(features, isFeature)) {
    if (roleOf(*channel) == Role::Statistic)
      addVariance(image, channel->name, pairing, weights, channel->values);
    else
      addMeans(image, channel->name, pairing, weights, channel->values, features.get("A"), true);
  }
}

void addFeatures(DeepImage& image, const flat::Image& features) {
  const Buffer<float> share = effectiveAlpha(image);
  const std::span<const float> alpha = std::as_const(image).get("A");
  const flat::Plane* flatAlpha = features.find("A");
  const Box box = intersect(image.dataWindow, features.dataWindow);
  for (const flat::Plane& plane : features.planes) {
    if (!isFeature(plane.name)) continue;
    const bool variance = roleOf(plane.name, PixelType::Float) == Role::Statistic;
    Buffer<float>& result = image.add(plane.name, PixelType::Float).values;
    result.fill(0);
    parallelFor(box.y0, std::max(box.y0, box.y1), [&](int y) {
      for (int x = box.x0; x < box.x1; ++x) {
        const size_t pixel = image.dataWindow.index(x, y), place = features.dataWindow.index(x, y);
        const size_t first = size_t(image.offsets[pixel]), last = size_t(image.offsets[pixel + 1]);
        double total = 0;
        for (size_t i = first; i < last; ++i) total += double(share[i]);
        const double coverage = flatAlpha ? opacity(flatAlpha->values[place]) : total;
        const double value = double(plane.values[place]);
        for (size_t i = first; i < last; ++i) {
          if (variance)
            result[i] = share[i] > 0 ? float(value * total / double(share[i])) : 0;
          else
            result[i] = coverage > 0 ? float(value / coverage * opacity(alpha[i])) : 0;
        }
      }
    });
  }
}

void addHalf(DeepImage& image, const DeepImage& half, int index, double samplesPerPixel) {
  const Pairing pairing(image, half);
  const Buffer<double> weights = pairing.sum([&](size_t i) { return pairing.weight(i); });
  const std::string prefix = index == 0 ? "half0." : "half1.";
  for (const Channel* channel : channelsWhere(half, isColour))
    addMeans(image, prefix + channel->name, pairing, weights, channel->values, half.get("A"), false);
  const std::span<const float> samples = half.tryGet("samples");
  const Buffer<double> counts = pairing.sum([&](size_t i) {
    return samples.empty() ? pairing.weight(i) * samplesPerPixel : pairing.weight(i) > 0 ? double(samples[i]) : 0;
  });
  Buffer<float>& result = image.add(prefix + "samples", PixelType::Float).values;
  for (size_t b = 0; b < result.size(); ++b) result[b] = float(counts[b]);
}

void replaceAlpha(DeepImage& image, const DeepImage& better) {
  const Pairing pairing(image, better);
  const Buffer<double> share = pairing.sum([&](size_t i) { return pairing.weight(i); });
  const std::span<float> alpha = image.get("A");
  Buffer<float> factor(image.samples(), 1.0f);
  pairing.forEachPixel([&](size_t first, size_t bins, size_t, size_t) {
    double passed = 1;
    for (size_t b = first; b < first + bins; ++b) {
      const double a = share[b] > 0 ? std::min(1.0, share[b] / passed) : 0;
      passed = std::max(passed - share[b], 0.0);
      factor[b] = opacity(alpha[b]) > 0 ? float(a / opacity(alpha[b])) : 0;
      alpha[b] = float(a);
    }
  });
  for (Channel& channel : image.channels) {
    const Role role = roleOf(channel);
    if (role != Role::Premultiplied && role != Role::Half) continue;
    for (size_t b = 0; b < factor.size(); ++b) channel.values[b] *= factor[b];
  }
}

}  // namespace fathom::deep
