// Flat frames of values at the ends of what files hold, and what a box mean makes of them.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "flat/noise.h"
#include "tests/reference/noisy_flat.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::stress {

inline constexpr std::pair<int, int> kFlatShapes[] = {{1, 1}, {1, 23}, {31, 1}, {22, 17}};
inline constexpr float kFlatLargest[] = {6e4f, 1e7f, 9e14f};

inline double valueAt(const flat::Image& image, const std::string& name, size_t i) {
  return double(image.get(name).values[i]);
}

// A frame, and what a box mean makes of it.
struct Scene {
  flat::Image noisy, denoised;
  flat::Noise noise;

  Scene(int width, int height, unsigned seed, float largest, bool fromHalves = false)
      : noisy(extremeFlat({.width = width, .height = height, .seed = seed, .largest = largest})),
        denoised(reference::boxMean(noisy)) {
    if (fromHalves)
      std::erase_if(noisy.planes, [](const flat::Plane& plane) { return plane.name.starts_with("variance."); });
    noise = flat::noiseOf(noisy);
  }
  size_t pixels() const { return noisy.dataWindow.area(); }
};

// Calls look(scene) for frames of all shapes and magnitudes.
template <class Look>
void forScenes(const Look& look) {
  for (int round = 0; round < rounds(); ++round)
    for (const auto& [width, height] : kFlatShapes)
      for (const float largest : kFlatLargest)
        for (const bool fromHalves : {false, true}) {
          SCOPED_TRACE(testing::Message()
                       << width << "x" << height << " to " << largest << (fromHalves ? ", halves" : ""));
          look(Scene(width, height, unsigned(13 * round + width), largest, fromHalves));
        }
}

}  // namespace fathom::stress
