// A small deep frame as a renderer would make it, with the same bins free of noise beside it, for tests.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::reference {

struct FrameParams {
  int width = 48, height = 40;
  int x0 = -5, y0 = -7;  // of the data window
  unsigned seed = 1;
  int spp = 32;
  bool volumes = false;   // the disc is a volume and there is a channel ZBack
  bool emission = false;  // every seventh pixel has a glow in front: A = 0, no camera samples
  // How noisy the camera samples are at a pixel of the window, counted from its corner: each is (1 - noise) of the
  // light and noise times an exponentially distributed part, which has the same mean.
  std::function<float(int x, int y)> noise = [](int, int) { return 0.7f; };
  // What sees nothing: by default a corner.
  std::function<bool(int x, int y)> empty = [](int x, int y) { return x < 6 && y < 5; };
  // The light on a bin without its noise.
  std::function<float(int x, int y)> light = [](int x, int y) { return 0.6f + 0.3f * std::sin(0.11f * float(x + y)); };
};

struct RenderedFrame {
  deep::DeepImage noisy, truth;  // truth: R G B, diffuse.*, specular.*, A and Z of the same bins
};

namespace detail {

// One bin of the scene: a ground behind everything, a disc with soft edges, and thin blades in front of both.
struct FrameBin {
  int x, y, samples;
  float alpha, z, zBack;
  std::array<float, 3> albedo;
  std::array<float, 3> normal;
  float specular;
  uint32_t id;
};

inline std::vector<FrameBin> binsOf(const FrameParams& p, int x, int y, std::mt19937& random) {
  std::vector<FrameBin> bins;
  if (p.empty(x, y)) return bins;
  int left = p.spp;
  const auto add = [&](int samples, float z, float zBack, const std::array<float, 3>& albedo, float nx, float specular,
                       uint32_t id) {
    samples = std::min(samples, left);
    if (samples <= 0) return;
    const float alpha = samples == left ? 1.0f : float(samples) / float(left);
    bins.push_back({x, y, samples, alpha, z, zBack, albedo, {nx, 0, std::sqrt(1 - nx * nx)}, specular, id});
    left -= samples;
  };
  const float tilt = 0.01f * float(x);
  if (p.emission && (x + 3 * y) % 7 == 0)
    bins.push_back({x, y, 0, 0.0f, 1.5f, 1.5f, {0.5f, 0.5f, 0.5f}, {0, 0, 1}, 0.1f, 9});
  if (x % 6 < 2) add(1 + int(random() % unsigned(p.spp / 2)), 2 + tilt, 2 + tilt, {0.1f, 0.5f, 0.15f}, 0.6f, 0.05f, 7u);
  const float dx = float(x) - 0.55f * float(p.width), dy = float(y) - 0.5f * float(p.height);
  const float inside = 0.3f * float(p.width) - std::sqrt(dx * dx + dy * dy);
  const float texture = (x / 4 + y / 4) % 2 ? 0.8f : 0.3f;
  if (inside > -2)
    add(int(float(p.spp) * std::min(1.0f, 0.25f * (inside + 2))), 5 + tilt, p.volumes ? 6 + tilt : 5 + tilt,
        {texture, 0.4f, 0.2f}, 0.2f, 0.3f, 4000000007u);
  add(left, 10 - tilt, 10 - tilt, {0.5f, 0.5f, texture}, 0, 0.1f, 2u);
  return bins;
}

}  // namespace detail

inline RenderedFrame renderFrame(const FrameParams& p = {}) {
  using deep::PixelType;
  std::mt19937 random(p.seed);
  deep::DeepImage image;
  image.dataWindow = {p.x0, p.y0, p.x0 + p.width, p.y0 + p.height};
  image.displayWindow = {0, 0, p.width, p.height};
  image.offsets = Buffer<uint64_t>(image.pixels() + 1, 0);
  std::vector<detail::FrameBin> bins;
  for (int y = 0; y < p.height; ++y)
    for (int x = 0; x < p.width; ++x) {
      const auto here = detail::binsOf(p, x, y, random);
      bins.insert(bins.end(), here.begin(), here.end());
      image.offsets[size_t(y) * size_t(p.width) + size_t(x) + 1] = bins.size();
    }
  RenderedFrame frame{image.copyLayout(), image.copyLayout()};
  frame.noisy.attributes.set("fathom:spp", p.spp);
  const auto plane = [&](deep::DeepImage& to, const std::string& name) {
    return to.add(name, PixelType::Float).values.data();
  };
  const auto fill = [&](deep::DeepImage& to, const std::string& name, auto value) {
    float* values = plane(to, name);
    for (size_t i = 0; i < bins.size(); ++i) values[i] = value(bins[i]);
  };
  for (deep::DeepImage* to : {&frame.noisy, &frame.truth}) {
    fill(*to, "A", [](const auto& b) { return b.alpha; });
    fill(*to, "Z", [](const auto& b) { return b.z; });
  }
  if (p.volumes) fill(frame.noisy, "ZBack", [](const auto& b) { return b.zBack; });
  fill(frame.noisy, "samples", [](const auto& b) { return float(b.samples); });
  const auto firstHalf = [](const auto& b) { return (b.samples + b.y % 2) / 2; };
  fill(frame.noisy, "half0.samples", [&](const auto& b) { return float(firstHalf(b)); });
  fill(frame.noisy, "half1.samples", [&](const auto& b) { return float(b.samples - firstHalf(b)); });
  fill(frame.noisy, "variance.Z", [](const auto&) { return 1e-4f; });
  fill(frame.noisy, "crypto", [](const auto& b) { return 0.25f * float(b.x); });
  Buffer<uint32_t>& ids = frame.noisy.add("id", PixelType::Uint).ids;
  for (size_t i = 0; i < bins.size(); ++i) ids[i] = bins[i].id;

  // The light of each camera sample over its mean, less one; the same in all channels of a component.
  const auto first = std::as_const(frame.noisy).get("half0.samples");
  std::exponential_distribution<double> draw(1);
  for (size_t l = 0; l < 2; ++l) {
    const std::string layer = l ? "specular." : "diffuse.";
    std::vector<std::array<double, 3>> mean(bins.size());  // of half 0, half 1, and all
    std::vector<double> variance(bins.size());
    for (size_t i = 0; i < bins.size(); ++i) {
      const detail::FrameBin& b = bins[i];
      double sum[2] = {0, 0}, squares = 0;
      const int n[2] = {int(first[i]), b.samples - int(first[i])};
      for (int h = 0; h < 2; ++h)
        for (int s = 0; s < n[h]; ++s) {
          const double e = double(p.noise(b.x, b.y)) * (draw(random) - 1);
          sum[h] += e;
          squares += e * e;
        }
      const double all = b.samples > 0 ? (sum[0] + sum[1]) / b.samples : 0;
      mean[i] = {n[0] ? sum[0] / n[0] : 0, n[1] ? sum[1] / n[1] : 0, all};
      if (b.samples > 1) variance[i] = std::max(0.0, squares / b.samples - all * all) / (b.samples - 1);
    }
    for (size_t c = 0; c < 3; ++c) {
      const std::string rgb(1, "RGB"[c]);
      const auto light = [&](const detail::FrameBin& b) {
        const float white = p.light(b.x, b.y);
        return l ? white * b.specular : white * b.albedo[c];
      };
      const auto write = [&](deep::DeepImage& to, const std::string& name, auto value) {
        float* values = plane(to, name);
        for (size_t i = 0; i < bins.size(); ++i) {
          const float shade = bins[i].samples > 0 ? bins[i].alpha : 1.0f;
          values[i] = shade * light(bins[i]) * float(1 + value(i));
        }
      };
      write(frame.truth, layer + rgb, [](size_t) { return 0.0; });
      write(frame.noisy, layer + rgb, [&](size_t i) { return mean[i][2]; });
      for (size_t h = 0; h < 2; ++h) {
        const std::string name = fmt::format("half{}.{}{}", h, layer, rgb);
        write(frame.noisy, name, [&](size_t i) { return mean[i][h]; });
        float* values = frame.noisy.get(name).data();
        const auto counts = std::as_const(frame.noisy).get(fmt::format("half{}.samples", h));
        for (size_t i = 0; i < bins.size(); ++i)
          if (counts[i] == 0) values[i] = 0;
      }
      // The components' noise is independent: variances of the whole colour add up.
      if (l == 0) fill(frame.noisy, "variance." + rgb, [](const auto&) { return 0.0f; });
      const auto total = frame.noisy.get("variance." + rgb);
      for (size_t i = 0; i < bins.size(); ++i) total[i] += float(double(light(bins[i])) * light(bins[i]) * variance[i]);
    }
  }
  for (size_t c = 0; c < 3; ++c) {
    const std::string rgb(1, "RGB"[c]), xyz(1, "XYZ"[c]);
    const auto sum = [&](deep::DeepImage& to, const std::string& half) {
      const auto d = std::as_const(to).get(fmt::format("{}diffuse.{}", half, rgb)),
                 s = std::as_const(to).get(fmt::format("{}specular.{}", half, rgb));
      float* values = plane(to, half + rgb);
      for (size_t i = 0; i < bins.size(); ++i) values[i] = d[i] + s[i];
    };
    sum(frame.truth, "");
    for (const char* half : {"", "half0.", "half1."}) sum(frame.noisy, half);
    for (const char* half : {"", "half0.", "half1."})
      fill(frame.noisy, fmt::format("{}albedo.{}", half, rgb), [&](const auto& b) { return b.alpha * b.albedo[c]; });
    fill(frame.noisy, "variance.albedo." + rgb, [](const auto&) { return 1e-5f; });
    fill(frame.noisy, "N." + xyz, [&](const auto& b) { return b.alpha * b.normal[c]; });
    fill(frame.noisy, "variance.N." + xyz, [](const auto&) { return 1e-5f; });
  }
  return frame;
}

// Squared error of the colours that are not premultiplied, averaged over the effective alpha of all bins.
inline double binError(const deep::DeepImage& image, const deep::DeepImage& truth) {
  double error = 0, weight = 0;
  const auto alpha = truth.get("A");
  for (const char* rgb : {"R", "G", "B"}) {
    const auto a = image.get(rgb), r = truth.get(rgb);
    for (size_t p = 0; p < truth.pixels(); ++p) {
      double passed = 1;
      for (size_t b = truth.offsets[p]; b < truth.offsets[p + 1]; ++b) {
        if (!(alpha[b] > 0)) continue;
        const double w = passed * double(alpha[b]), e = (double(a[b]) - double(r[b])) / double(alpha[b]);
        error += w * e * e;
        weight += w;
        passed *= 1 - double(alpha[b]);
      }
    }
  }
  return error / weight;
}

// Squared error of the flattened colours, averaged over the pixels.
inline double flatError(const deep::DeepImage& image, const deep::DeepImage& truth) {
  double error = 0;
  const auto alpha = truth.get("A");
  for (const char* rgb : {"R", "G", "B"}) {
    const auto a = image.get(rgb), r = truth.get(rgb);
    for (size_t p = 0; p < truth.pixels(); ++p) {
      double passed = 1, e = 0;
      for (size_t b = truth.offsets[p]; b < truth.offsets[p + 1]; ++b) {
        e += passed * (double(a[b]) - double(r[b]));
        passed *= 1 - double(alpha[b]);
      }
      error += e * e;
    }
  }
  return error / double(3 * truth.pixels());
}

}  // namespace fathom::reference
