// Deep images written out sample by sample, for tests.
#pragma once

#include <random>
#include <vector>

#include "deep/image.h"

namespace fathom::reference {

struct Sample {
  float z = 1, zBack = 1;
  float alpha = 0;
  float colour = 0;  // channel R, premultiplied; B holds twice that
  uint32_t id = 0;
};

using Pixels = std::vector<std::vector<Sample>>;

// The pixels in rows of `width`; channels R, B, A, Z, ZBack and id, or without ZBack where `volumes` is false.
inline deep::DeepImage makeDeep(const Pixels& pixels, int width, bool volumes = true) {
  const int height = int(pixels.size()) / width;
  deep::DeepImage image;
  image.dataWindow = {3, -2, 3 + width, -2 + height};
  image.displayWindow = {0, 0, 16, 16};
  image.offsets = Buffer<uint64_t>(pixels.size() + 1, 0);
  for (size_t i = 0; i < pixels.size(); ++i) image.offsets[i + 1] = image.offsets[i] + pixels[i].size();
  std::vector<Sample> all;
  for (const auto& pixel : pixels) all.insert(all.end(), pixel.begin(), pixel.end());
  const auto fill = [&](const char* name, auto value) {
    Buffer<float>& values = image.add(name, deep::PixelType::Float).values;
    for (size_t i = 0; i < all.size(); ++i) values[i] = value(all[i]);
  };
  fill("R", [](const Sample& s) { return s.colour; });
  fill("B", [](const Sample& s) { return 2 * s.colour; });
  fill("A", [](const Sample& s) { return s.alpha; });
  fill("Z", [](const Sample& s) { return s.z; });
  if (volumes) fill("ZBack", [](const Sample& s) { return s.zBack; });
  Buffer<uint32_t>& ids = image.add("id", deep::PixelType::Uint).ids;
  for (size_t i = 0; i < all.size(); ++i) ids[i] = all[i].id;
  return image;
}

// The samples of one pixel of such an image.
inline std::vector<Sample> samplesOf(const deep::DeepImage& image, size_t pixel) {
  std::vector<Sample> samples;
  const auto z = image.get("Z"), zBack = image.tryGet("ZBack"), alpha = image.get("A"), colour = image.get("R");
  for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i)
    samples.push_back({z[i], zBack.empty() ? z[i] : zBack[i], alpha[i], colour[i], image.find("id")->ids[i]});
  return samples;
}

// Points and volumes behind one another, opaque ones and empty pixels among them.
inline deep::DeepImage randomStack(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit;
  Pixels pixels(24);
  for (auto& pixel : pixels) {
    float z = unit(random);
    for (int n = int(random() % 6); n > 0; --n) {
      const float length = random() % 2 ? unit(random) : 0;
      const float alpha = random() % 4 ? unit(random) : 1;
      pixel.push_back({z, z + length, alpha, alpha * unit(random), uint32_t(random())});
      z += length + 0.1f + unit(random);
    }
  }
  return makeDeep(pixels, 6);
}

}  // namespace fathom::reference
