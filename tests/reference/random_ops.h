// Random deep images for the laws of compositing: sensible values by default, odd ones where a test asks for them.
#pragma once

#include <cmath>
#include <limits>
#include <random>

#include "deep/image.h"
#include "tests/reference/random_deep.h"

namespace fathom::reference {

struct SampleParams {
  Box window{-1, 2, 8, 9};
  unsigned seed = 1;
  bool volumes = false;  // every second sample; with ZBack for all
  unsigned most = 6;     // samples in a pixel; a fifth of the pixels are empty
  bool odd = false;      // coincident depths, alphas of 0, 1 and outside of [0,1], NaN and infinities, reversed ranges
  bool sorted = true;
};

// R G B A Z, with `volumes` ZBack, and the UINT channel id, which is different for every sample of the image.
inline deep::DeepImage randomSamples(const SampleParams& params) {
  std::mt19937 random(params.seed);
  std::uniform_real_distribution<float> unit(0, 1);
  deep::DeepImage image;
  image.dataWindow = image.displayWindow = params.window;
  image.offsets = Buffer<uint64_t>(params.window.area() + 1, 0);
  for (size_t i = 0; i < params.window.area(); ++i)
    image.offsets[i + 1] = image.offsets[i] + (random() % 5 == 0 ? 0 : 1 + random() % params.most);
  for (const char* name : {"R", "G", "B", "A", "Z"}) image.add(name, deep::PixelType::Float);
  if (params.volumes) image.add("ZBack", deep::PixelType::Float);
  image.add("id", deep::PixelType::Uint);
  const std::span<float> a = image.get("A"), z = image.get("Z");
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (size_t p = 0; p < image.pixels(); ++p) {
    float depth = 1;
    for (size_t s = image.offsets[p]; s < image.offsets[p + 1]; ++s) {
      const float alphas[] = {unit(random), unit(random), unit(random) * 0.01f, std::pow(10.0f, -30 * unit(random)),
                              random() % 8 ? 0.5f : 1.0f};
      const float oddAlphas[] = {0, 1, -0.5f, 1.5f, nan, 1 - 0x1p-24f, 1e-30f};
      a[s] = params.odd && random() % 3 == 0 ? oddAlphas[random() % 7] : alphas[random() % 5];
      depth = params.sorted ? depth + 0.1f + unit(random) : 1 + float(random() % 40) * 0.25f;
      z[s] = depth;
      if (params.odd && random() % 8 == 0) z[s] = std::floor(depth);
      if (params.odd && random() % 20 == 0) z[s] = random() % 2 ? nan : inf;
      for (const char* name : {"R", "G", "B"}) {
        const float scale = std::isfinite(a[s]) ? std::min(std::max(a[s], 0.0f), 1.0f) : 1;
        float& value = image.get(name)[s] = scale * 2 * unit(random);
        if (params.odd && random() % 15 == 0) value = random() % 2 ? nan : 0.3f;  // emission where alpha is 0
      }
      image.find("id")->ids[s] = uint32_t(s) * 2654435761u + 1;
    }
  }
  if (params.volumes)
    for (size_t s = 0; s < image.samples(); ++s) {
      const bool volume = random() % 2;
      const float length = params.odd && random() % 6 == 0 ? -1.0f : 0.05f + 2 * unit(random);
      image.get("ZBack")[s] = volume ? z[s] + length : z[s];
    }
  return image;
}

}  // namespace fathom::reference
