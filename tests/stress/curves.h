// Two deep pixels seen from the front: what is seen of them, and what passes, up to every depth.
#pragma once

#include <vector>

#include "deep/flatten.h"
#include "tests/stress/exact_pixel.h"
#include "tests/stress/frames.h"
#include "tests/stress/worst.h"

namespace fathom::stress {

// The finite depths at which samples of a pixel begin and end; of many, some.
inline std::vector<Real> bordersOf(const ExactPixel& pixel) {
  std::vector<Real> all;
  for (const Medium& medium : pixel.media())
    for (const Real z : {medium.z, medium.zBack})
      if (std::isfinite(z)) all.push_back(z);
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  const size_t step = 1 + all.size() / 40;
  for (size_t i = 0; i < all.size(); i += step) all[i / step] = all[i];
  all.resize((all.size() + step - 1) / step);
  return all;
}

// Where an error was made.
struct Place {
  const Frame& frame;
  size_t pixel;
};

// Holds the curves of `found` to expectedLight(until, all) and expectedPassing(until) at its own borders and, `all`, in
// whole. `scale`: of the light.
template <class Light, class Passing>
void compareCurves(const Place& place, const ExactPixel& found, std::span<const float> values, Real scale,
                   const Light& expectedLight, const Passing& expectedPassing, Worst& light, Worst& passing) {
  scale += Real(std::numeric_limits<float>::min()) * Real(values.size());  // each is rounded there, too
  const auto put = [&](Worst& worst, Real is, Real shouldBe, Real unit) {
    worst.put(place.frame.name, place.frame.seed, place.pixel, is, shouldBe, unit);
  };
  for (const Real until : bordersOf(found)) {
    put(light, found.light(values, until, false), expectedLight(until, false), scale);
    put(passing, found.passing(until), expectedPassing(until), 1);
  }
  put(light, found.light(values, kForever, true), expectedLight(kForever, true), scale);
}

// The same for an image that is to show what another shows.
inline void compareImages(const Frame& frame, const deep::DeepImage& found, const deep::DeepImage& expected,
                          Worst& light, Worst& passing) {
  light.touch(frame.name), passing.touch(frame.name);
  for (size_t p = 0; p < expected.pixels(); ++p) {
    const ExactPixel is = exactPixel(found, p), shouldBe = exactPixel(expected, p);
    const auto values = valuesOf(expected, p, "G");
    compareCurves(
        {frame, p}, is, valuesOf(found, p, "G"), magnitude(values),
        [&](Real until, bool all) { return shouldBe.light(values, until, all); },
        [&](Real until) { return shouldBe.passing(until); }, light, passing);
  }
}

// That both flatten to the same channel coc, a mean by effective alpha.
inline void comparePlain(const Frame& frame, const deep::DeepImage& found, const deep::DeepImage& expected,
                         Worst& plain) {
  const flat::Image is = deep::flatten(found), shouldBe = deep::flatten(expected);
  plain.touch(frame.name);
  for (size_t p = 0; p < expected.pixels(); ++p)
    if (shouldBe.get("A").values[p] > 1e-30f)  // of denormal alphas a mean is not known
      plain.put(frame.name, frame.seed, p, is.get("coc").values[p], shouldBe.get("coc").values[p], 10);  // its range
}

}  // namespace fathom::stress
