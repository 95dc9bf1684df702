// A small noisy deep frame with everything that the channel convention knows, for tests.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::reference {

// Smooth surfaces at two depths with noisy colours: up to two bins in a pixel, some pixels empty. Camera samples are
// counted in halves. Different seeds give different noise.
inline deep::DeepImage makeNoisyFrame(int width, int height, unsigned seed) {
  constexpr int kSpp = 16;
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0.0f, 0.3f);
  deep::DeepImage image{{-2, 3, -2 + width, 3 + height}, {0, 0, width, height}, {}, {}, {}};
  image.offsets = Buffer<uint64_t>(image.pixels() + 1, 0);
  struct Bin {
    int x, y, samples;
    bool front;
  };
  std::vector<Bin> bins;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const size_t pixel = size_t(y) * size_t(width) + size_t(x);
      if ((x + y) % 11 != 0) {
        const int inFront = x % 3 == 0 ? 0 : 2 * (1 + int(random() % 7));
        if (inFront > 0) bins.push_back({x, y, inFront, true});
        bins.push_back({x, y, kSpp - inFront, false});
      }
      image.offsets[pixel + 1] = bins.size();
    }
  const auto fill = [&](const std::string& name, auto value) {
    Buffer<float>& values = image.add(name, deep::PixelType::Float).values;
    for (size_t i = 0; i < bins.size(); ++i) values[i] = value(bins[i]);
  };
  const auto alpha = [](const Bin& b) { return b.front ? float(b.samples) / kSpp : 1.0f; };
  fill("A", alpha);
  fill("Z", [](const Bin& b) { return (b.front ? 2.0f : 5.0f) + 0.01f * float(b.x); });
  fill("samples", [](const Bin& b) { return float(b.samples); });
  for (const char* half : {"half0.samples", "half1.samples"})
    fill(half, [](const Bin& b) { return float(b.samples) / 2; });
  for (size_t c = 0; c < 3; ++c) {
    const std::string end(1, "RGB"[c]), axis(1, "XYZ"[c]);
    const auto albedo = [&](const Bin& b) { return b.front ? 0.8f - 0.1f * float(c) : 0.4f + 0.1f * float(c); };
    for (const std::string layer : {"diffuse", "specular"}) {
      for (const std::string half : {"half0.", "half1."})
        fill(fmt::format("{}{}.{}", half, layer, end), [&](const Bin& b) {
          const float light = layer == "diffuse" ? albedo(b) : 0.2f;
          return alpha(b) * light * (1.0f + 0.01f * float(b.y) + noise(random) / std::sqrt(float(b.samples)));
        });
      const auto a = std::as_const(image).get(fmt::format("half0.{}.{}", layer, end));
      const auto b = std::as_const(image).get(fmt::format("half1.{}.{}", layer, end));
      std::vector<float> mean(a.size());
      for (size_t i = 0; i < mean.size(); ++i) mean[i] = (a[i] + b[i]) / 2;
      std::copy(mean.begin(), mean.end(),
                image.add(fmt::format("{}.{}", layer, end), deep::PixelType::Float).values.begin());
    }
    for (const std::string prefix : {"", "half0.", "half1."}) {
      const auto d = std::as_const(image).get(fmt::format("{}diffuse.{}", prefix, end)),
                 s = std::as_const(image).get(fmt::format("{}specular.{}", prefix, end));
      std::vector<float> sum(d.size());
      for (size_t i = 0; i < sum.size(); ++i) sum[i] = d[i] + s[i];
      std::copy(sum.begin(), sum.end(), image.add(prefix + end, deep::PixelType::Float).values.begin());
    }
    fill("variance." + end, [&](const Bin& b) { return 0.09f / float(b.samples); });
    fill("albedo." + end, [&](const Bin& b) { return alpha(b) * albedo(b); });
    for (const std::string half : {"half0.albedo.", "half1.albedo."})
      fill(half + end, [&](const Bin& b) { return alpha(b) * albedo(b); });
    fill("variance.albedo." + end, [](const Bin&) { return 1e-5f; });
    fill("N." + axis, [&](const Bin& b) { return c == 2 ? alpha(b) : 0.0f; });
    fill("variance.N." + axis, [](const Bin&) { return 1e-5f; });
  }
  fill("variance.Z", [](const Bin&) { return 1e-4f; });
  Buffer<uint32_t>& ids = image.add("id", deep::PixelType::Uint).ids;
  for (size_t i = 0; i < bins.size(); ++i) ids[i] = bins[i].front ? 4000000007u : 2u;
  fill("crypto", [](const Bin& b) { return 0.25f * float(b.x); });
  image.attributes.set("fathom:spp", kSpp);
  image.attributes.set("artist", std::string("nobody"));
  return image;
}

}  // namespace fathom::reference
