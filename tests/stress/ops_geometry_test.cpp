// Operations that move, mix and thin out samples, at the ends of the numbers.
#include <gtest/gtest.h>

#include <cfloat>

#include "deep/ops/compress.h"
#include "deep/ops/keymix.h"
#include "deep/ops/limit.h"
#include "deep/ops/resize.h"
#include "deep/ops/transform.h"
#include "deep/tidy.h"
#include "tests/reference/random_deep.h"
#include "tests/stress/curves.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

// A new sample's alpha and its weights are rounded once each, and its light (see ops_merge_test.cpp); the headers promise
// four times that. Of the largest sum of magnitudes of a pixel that has a say.
constexpr double kMixed = 0x1.1p-23;

TEST(StressTransform, MovesDepthsInDouble) {
  Worst worst("transform: depths", 0x1.01p-24);
  forEachFrame([&](const Frame& frame) {
    worst.touch(frame.name);
    for (const auto& [scale, offset] : {std::pair(1000.0, 0.0), std::pair(1e-3, 5.0), std::pair(1.0, 1e9)}) {
      const DeepImage found = deep::transform(frame.image.copy(), {.z = offset, .zScale = scale});
      const auto z = found.get("Z"), zBack = found.tryGet("ZBack"), before = frame.image.get("Z");
      for (size_t s = 0; s < z.size(); ++s) {
        const Real expected = Real(before[s]) * Real(scale) + Real(offset);
        if (std::isfinite(before[s])) worst.put(frame.name, frame.seed, s, z[s], expected, std::abs(expected));
        if (zBack.empty()) continue;
        const bool was = frame.image.get("ZBack")[s] > before[s];
        EXPECT_EQ(zBack[s] > z[s], was) << frame.name << ", seed " << frame.seed;  // ranges stay ranges
      }
    }
  });
}

// Pixels are mixed once they are tidy: what they are mixed of is compared with that, and tidying on its own.
DeepImage tidied(const DeepImage& image) {
  return deep::tidy(image.copy()).image;
}

// The weighted sum of pixels' curves.
struct Blend {
  std::vector<std::pair<Real, ExactPixel>> pixels;
  std::vector<std::vector<float>> values;
  Real empty = 1, scale = FLT_MIN;

  void add(const DeepImage& image, size_t pixel, Real weight) {
    const auto of = valuesOf(image, pixel, "G");
    pixels.emplace_back(weight, exactPixel(image, pixel));
    values.emplace_back(of.begin(), of.end());
    empty -= weight;
    scale = std::max(scale, magnitude(of));
  }
  Real light(Real until, bool all) const {
    Real sum = 0;
    for (size_t i = 0; i < pixels.size(); ++i) sum += pixels[i].first * pixels[i].second.light(values[i], until, all);
    return sum;
  }
  Real passing(Real until) const {
    Real sum = empty;
    for (const auto& [weight, pixel] : pixels) sum += weight * pixel.passing(until);
    return sum;
  }
};

// Of the whole and, where no depths were put together, at every depth.
void compareBlend(const Frame& frame, const DeepImage& found, size_t pixel, const Blend& blend, bool depths,
                  Worst& light, Worst& passing) {
  const auto values = valuesOf(found, pixel, "G");
  const ExactPixel exact = exactPixel(found, pixel);
  const Real scale = blend.scale + Real(FLT_MIN) * Real(values.size());
  if (depths)
    compareCurves(
        {frame, pixel}, exact, values, scale, [&](Real until, bool all) { return blend.light(until, all); },
        [&](Real until) { return blend.passing(until); }, light, passing);
  light.put(frame.name, frame.seed, pixel, exact.light(values, kForever, true), blend.light(kForever, true), scale);
}

TEST(StressResample, IsTheMeanOfWhatIsCovered) {
  Worst light("resample: light", kMixed), passing("resample: transmittance", kMixed);
  const std::pair<int, int> sizes[] = {{8, 6}, {5, 12}, {16, 1}, {37, 5}};  // of a display window of 16 x 12
  forEachFrame([&](const Frame& frame) {
    light.touch(frame.name), passing.touch(frame.name);
    const auto [width, height] = sizes[frame.seed % 4];
    const DeepImage source = tidied(frame.image);
    const double tolerance = frame.seed % 2 ? 0.0 : 0.01;
    const deep::Resampling how = deep::resizing(frame.image.displayWindow, width, height, deep::Filter::Box, tolerance);
    const DeepImage found = deep::resize(frame.image.copy(), width, height, deep::Filter::Box, tolerance);
    const Box from = frame.image.dataWindow, window = found.dataWindow;
    const auto overlap = [](const deep::AxisMap& map, int to, int column) {
      const Real low = map.source(to), high = map.source(to + 1);
      return std::max(Real(0), std::min(high, Real(column + 1)) - std::max(low, Real(column))) / (high - low);
    };
    for (int y = window.y0; y < window.y1; ++y)
      for (int x = window.x0; x < window.x1; ++x) {
        Blend blend;
        for (int sy = from.y0; sy < from.y1; ++sy)
          for (int sx = from.x0; sx < from.x1; ++sx)
            if (const Real weight = overlap(how.columns, x, sx) * overlap(how.rows, y, sy); weight > 1e-9L)
              blend.add(source, from.index(sx, sy), weight);
        compareBlend(frame, found, window.index(x, y), blend, tolerance == 0, light, passing);
      }
  });
}

TEST(StressKeymix, IsTheMeanOfBoth) {
  Worst light("keymix: light", kMixed), passing("keymix: transmittance", kMixed);
  forEachFrame([&](const Frame& frame) {
    const DeepImage one = tidied(frame.image), other = tidied(extremeDeep(frame.params, frame.seed + 5000));
    flat::Image matte{frame.image.dataWindow, frame.image.displayWindow, {}, {}};
    const float mattes[] = {0, 1, 0.5f, 1e-30f, 0x1p-149f, 1 - 0x1p-24f, 0.1f, -1, 7, std::nanf("")};
    Buffer<float>& values = matte.add("m").values;
    for (size_t p = 0; p < values.size(); ++p) values[p] = mattes[(p + frame.seed) % std::size(mattes)];
    const DeepImage found = deep::keymix(one, other, matte, "m");
    light.touch(frame.name), passing.touch(frame.name);
    for (size_t p = 0; p < found.pixels(); ++p) {
      const Real m = values[p] > 0 ? std::min(Real(values[p]), Real(1)) : Real(0);
      Blend blend;
      if (m > 0) blend.add(one, p, m);
      if (m < 1) blend.add(other, p, 1 - m);
      compareBlend(frame, found, p, blend, true, light, passing);
    }
  });
}

TEST(StressLimit, ChangesNothingOfTheWhole) {
  Worst light("limit: light", kMixed), alpha("limit: alpha", kMixed), plain("limit: coc", kMixed);
  forEachFrame([&](const Frame& frame) {
    light.touch(frame.name), alpha.touch(frame.name);
    for (const int most : {1, 2, 5}) {
      const DeepImage found = deep::limit(frame.image.copy(), most);
      comparePlain(frame, found, frame.image, plain);
      for (size_t p = 0; p < found.pixels(); ++p) {
        EXPECT_LE(found.count(p), size_t(most));
        const ExactPixel exact = exactPixel(found, p), whole = exactPixel(frame.image, p);
        const auto values = valuesOf(frame.image, p, "G");
        light.put(frame.name, frame.seed, p, exact.light(valuesOf(found, p, "G"), kForever, true),
                  whole.light(values, kForever, true), magnitude(values));
        alpha.put(frame.name, frame.seed, p, exact.alphaOfAll(), whole.alphaOfAll());
      }
    }
  });
}

TEST(StressCompress, StaysWithinItsErrorAtEveryDepth) {
  constexpr double kAllowed = 0.01;
  // Its error, and what is rounded; the whole is exact but for that. Behind samples that let little pass the FLOAT alpha of what
  // they become counts: see the header.
  constexpr Real kLeastPassing = 1e-4;
  Worst light("compress: light, 0.01 allowed", kAllowed + 0x1p-24 / double(kLeastPassing)),
      passing("compress: transmittance, 0.01 allowed", kAllowed + 1e-6);
  Worst whole("compress: the whole", 2 * kMixed);  // denormal light is rounded twice, by steps of 1e-7 of the unit
  forEachFrame([&](const Frame& frame) {
    const DeepImage found = deep::compress(frame.image.copy(), {.error = kAllowed});
    light.touch(frame.name), passing.touch(frame.name), whole.touch(frame.name);
    for (size_t p = 0; p < found.pixels(); ++p) {
      const ExactPixel is = exactPixel(found, p), was = exactPixel(frame.image, p);
      const auto values = valuesOf(frame.image, p, "G"), now = valuesOf(found, p, "G");
      Real brightest = FLT_MIN;
      for (const char* name : {"R", "G", "B"})
        brightest = std::max(brightest, was.light(valuesOf(frame.image, p, name), kForever, true));
      for (const ExactPixel* borders : {&is, &was})
        for (const Real until : bordersOf(*borders)) {
          // Together opaque volumes are opaque from their front on: see the header.
          if (was.passing(until) < 0x1p-24) continue;
          if (was.passing(until) >= kLeastPassing)
            light.put(frame.name, frame.seed, p, is.light(now, until, false), was.light(values, until, false),
                      brightest);
          passing.put(frame.name, frame.seed, p, is.passing(until), was.passing(until));
        }
      whole.put(frame.name, frame.seed, p, is.light(now, kForever, true), was.light(values, kForever, true),
                magnitude(values));
      EXPECT_LE(found.count(p), deep::tidy(frame.image.copy()).image.count(p));
    }
  });
}

}  // namespace
}  // namespace fathom::stress
