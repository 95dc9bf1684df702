// A deep frame to measure on.
#pragma once

#include <array>
#include <cmath>
#include <random>

#include "deep/image.h"

namespace fathom::bench {

// A thicket before a smooth ground: 0 to 16 samples a pixel, half of them thin volumes; grainy half-float colours, as a
// render has them.
inline deep::DeepImage thicket(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  const Box window{0, 0, width, height};
  deep::DeepImage image{window, window, Buffer<uint64_t>(window.area() + 1, 0), {}, {}};
  for (size_t p = 0; p < window.area(); ++p) image.offsets[p + 1] = image.offsets[p] + random() % 17;
  for (const char* name : {"R", "G", "B", "A"}) image.add(name, deep::PixelType::Half);
  for (const char* name : {"Z", "ZBack"}) image.add(name, deep::PixelType::Float);
  const std::span<float> alphas = image.get("A"), z0 = image.get("Z"), z1 = image.get("ZBack");
  const std::array<std::span<float>, 3> colours{image.get("R"), image.get("G"), image.get("B")};
  for (size_t p = 0; p < window.area(); ++p) {
    float z = 2 + unit(random);
    for (size_t s = image.offsets[p]; s < image.offsets[p + 1]; ++s) {
      z += 0.05f + 0.3f * unit(random);
      const float alpha = std::floor(256 * (0.05f + 0.6f * unit(random))) / 256;
      alphas[s] = alpha;
      z0[s] = z;
      z1[s] = random() % 2 ? z + 0.04f : z;
      for (const std::span<float>& colour : colours) colour[s] = std::floor(1024 * alpha * unit(random)) / 1024;
    }
  }
  return image;
}

}  // namespace fathom::bench
