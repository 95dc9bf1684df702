// Deep frames at the ends of what a file may hold, for the stress of operations: values from denormal to 1e15, alphas
// from 1e-45 to 1 - 2^-24, depths from 1e-6 to 1e9 and infinity, equal ones and neighbouring floats, thousands of
// samples in a pixel, and samples that no file should have.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::stress {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct ExtremeParams {
  Box window{-2, 3, 5, 8};
  unsigned most = 8;        // samples in a pixel
  double empty = 0.2;       // part of the pixels
  bool volumes = true;      // with ZBack; half of the samples, which overlap as they like
  bool values = false;      // colours from denormal to 1e15; else about 1
  bool alphas = false;      // from 0 over 1e-45 to 1 - 2^-24 and 1; else from 0.05 to 0.95
  bool depths = false;      // from 1e-6 to 1e9, equal, neighbours, infinite; else from 1 to 20
  bool coincident = false;  // depths of few different values
  float largest = 1e15f;    // of the values, and of their sum in a pixel: 65504 is a half's end
  float longest = 5;        // volume, where depths are not extreme
};

// What is drawn, and what it is called in the table.
struct ExtremeCase {
  std::string name;
  ExtremeParams params;
};

inline std::vector<ExtremeCase> extremeCases(bool volumes = true) {
  std::vector<ExtremeCase> cases = {
      {"values 1e-45 to 1e15", {.values = true}},
      {"values to 65504", {.values = true, .largest = 65504}},
      {"alphas 0, 1e-45 to 1-2^-24, 1", {.alphas = true}},
      {"depths 1e-6 to 1e9, infinite", {.depths = true}},
      {"equal depths", {.alphas = true, .coincident = true}},
      {"all at once", {.most = 12, .values = true, .alphas = true, .depths = true}},
      {"1 x 1 pixel", {.window = {3, -7, 4, -6}, .empty = 0, .values = true, .alphas = true}},
      {"1 x 23 pixels", {.window = {0, -9, 1, 14}, .values = true, .alphas = true}},
      {"23 x 1 pixels", {.window = {-20, 4, 3, 5}, .values = true, .alphas = true}},
      {"no pixels", {.window = {5, 5, 5, 5}}},
      {"no samples", {.empty = 1}},
      {"sparse", {.window = {0, 0, 23, 17}, .empty = 0.97, .values = true, .alphas = true, .depths = true}},
      {"1,000 samples", {.window = {0, 0, 2, 1}, .most = 1000, .empty = 0, .alphas = true, .longest = 0.05f}},
  };
  for (ExtremeCase& one : cases) one.params.volumes = volumes;
  return cases;
}

class ExtremeDraw {
 public:
  ExtremeDraw(const ExtremeParams& params, unsigned seed) : params_(params), random_(seed * 7919 + 1) {}

  deep::DeepImage draw() {
    deep::DeepImage image;
    image.dataWindow = params_.window;
    image.displayWindow = {-4, 0, 12, 12};
    image.offsets = Buffer<uint64_t>(params_.window.area() + 1, 0);
    for (size_t i = 0; i < params_.window.area(); ++i)
      image.offsets[i + 1] = image.offsets[i] + (unit() < params_.empty ? 0 : count());
    for (const char* name : {"R", "G", "B", "A", "Z"}) image.add(name, deep::PixelType::Float);
    if (params_.volumes) image.add("ZBack", deep::PixelType::Float);
    image.add("coc", deep::PixelType::Float);
    image.add("id", deep::PixelType::Uint);
    for (size_t p = 0; p < image.pixels(); ++p) drawPixel(image, p);
    return image;
  }

 private:
  float unit() { return std::uniform_real_distribution<float>(0, 1)(random_); }
  size_t below(size_t end) { return random_() % end; }
  size_t count() { return params_.most > 100 ? params_.most : 1 + below(params_.most); }
  template <class T, size_t N>
  T oneOf(const T (&values)[N]) {
    return values[below(N)];
  }

  float value(float largest) {
    if (!params_.values) return 2 * unit();
    const float magnitudes[] = {0,    0x1p-149f, 1e-40f, 1.2e-38f, 1e-30f, 1e-12f, 1e-5f,
                                0.1f, 1,         1000,   65504,    1e9f,   1e14f,  largest};
    return std::min(largest, oneOf(magnitudes) * (below(4) ? 1 - 0.9f * unit() : 1));
  }
  float alpha() {
    if (!params_.alphas) return 0.05f + 0.9f * unit();
    const float alphas[] = {0,    0,      0x1p-149f, 1.2e-38f,     1e-30f,       1e-12f, 3e-8f, 1e-4f,
                            0.5f, unit(), 1 - 1e-4f, 1 - 0x1p-23f, 1 - 0x1p-24f, unit(), 1};
    return oneOf(alphas);
  }
  // The next depth behind `before`, or at it.
  float step(float before) {
    if (params_.coincident) return 1 + float(below(4));
    if (!params_.depths) return params_.most > 100 ? before + 0.001f + 0.01f * unit() : 1 + 19 * unit();
    switch (below(6)) {
      case 0:
        return before;
      case 1:
        return std::nextafter(before, kInfinity);
      case 2:
        return before * (1 + 1e-5f * unit());
      case 3:
        return below(12) ? before * 2 : kInfinity;
      default:
        return std::pow(10.0f, -6 + 15 * unit());
    }
  }
  float length(float z) {
    if (params_.coincident) return float(1 + below(3));
    if (!params_.depths) return params_.longest * unit();
    const float lengths[] = {std::nextafter(z, kInfinity) - z, z * 1e-5f, z, 1e9f, unit()};
    return oneOf(lengths);
  }

  void drawPixel(deep::DeepImage& image, size_t pixel) {
    // Half of the pixels have values of one magnitude, so that their errors show.
    const float most = params_.largest / float(std::max<size_t>(image.count(pixel), 1));
    const float largest = below(2) ? most : std::min(most, std::pow(10.0f, -44 + 58 * unit()));
    float before = params_.depths ? 1e-6f : 1;
    for (size_t s = image.offsets[pixel]; s < image.offsets[pixel + 1]; ++s) {
      const float a = image.get("A")[s] = alpha(), z = image.get("Z")[s] = step(before);
      before = std::isfinite(z) ? z : before;
      const float factor = below(2) ? a : 1;  // else mostly emission
      for (const char* name : {"R", "G", "B"}) image.get(name)[s] = factor * value(largest);
      image.get("coc")[s] = 10 * unit();
      image.find("id")->ids[s] = below(8) ? uint32_t(below(5)) : uint32_t(random_());
      if (params_.volumes) image.get("ZBack")[s] = below(2) && std::isfinite(z) ? z + length(z) : z;
    }
  }

  ExtremeParams params_;
  std::mt19937 random_;
};

inline deep::DeepImage extremeDeep(const ExtremeParams& params, unsigned seed) {
  return ExtremeDraw(params, seed).draw();
}

// Spoils about `part` of the samples, each in one channel: NaN, infinities, negative and far too large values, ranges that
// are reversed. Returns which pixels have any.
inline std::vector<bool> poison(deep::DeepImage& image, double part, unsigned seed) {
  std::mt19937 random(seed + 77);
  std::vector<bool> hit(image.pixels(), false);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float odd[] = {nan, -nan, kInfinity, -kInfinity, 3e38f, -3e38f, 1.1e15f, -1, -1e-30f, -0.0f, 2};
  std::vector<std::string> names = {"R", "G", "B", "A", "Z"};
  if (image.find("ZBack")) names.emplace_back("ZBack");
  for (size_t p = 0; p < image.pixels(); ++p)
    for (size_t s = image.offsets[p]; s < image.offsets[p + 1]; ++s) {
      if (std::uniform_real_distribution<double>(0, 1)(random) >= part) continue;
      image.get(names[random() % names.size()])[s] = odd[random() % std::size(odd)];
      hit[p] = true;
    }
  return hit;
}

}  // namespace fathom::stress
