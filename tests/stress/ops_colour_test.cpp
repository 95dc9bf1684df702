// Colours at the ends of the numbers: grade, recolour, expression, deepen, ids.
#include <gtest/gtest.h>

#include <cfloat>

#include "deep/flatten.h"
#include "deep/ops/deepen.h"
#include "deep/ops/expression.h"
#include "deep/ops/grade.h"
#include "deep/ops/ids.h"
#include "deep/ops/recolour.h"
#include "tests/reference/random_deep.h"
#include "tests/stress/curves.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

constexpr Real kLargest = 1e15L;

// One sample's colour graded in long double; `alpha` is its opacity.
struct Graded {
  std::array<Real, 3> colour;
  Real scale;  // the largest term of any sum on the way, in units of the result
};
Graded graded(const std::array<Real, 3>& in, Real alpha, const deep::GradeParams& params) {
  const std::array<Real, 3> luminance{0.2126f, 0.7152f, 0.0722f};
  Graded result{{}, 0};
  Real grey = 0;
  for (size_t c = 0; c < 3; ++c) {
    const Real gain = params.gain[c], offset = params.offset[c];
    Real value = std::clamp(in[c] * gain + alpha * offset, -kLargest, kLargest),
         terms = std::abs(in[c] * gain) + std::abs(alpha * offset) + FLT_MIN;
    const Real power = Real(1.0f / params.gamma[c]);
    if (power != 1 && alpha > 0 && value > 0) {
      const Real before = value;
      value = std::pow(before / alpha, power) * alpha;
      terms *= value / before;  // a relative error goes through the power
    }
    result.colour[c] = std::min(value, kLargest);
    result.scale += terms;
    grey += luminance[c] * result.colour[c];
  }
  for (size_t c = 0; c < 3 && params.saturation != 1; ++c)
    result.colour[c] = grey + Real(params.saturation) * (result.colour[c] - grey);
  for (Real& value : result.colour) value = std::clamp(value, -kLargest, kLargest);
  return result;
}

void checkGrade(const Frame& frame, const deep::GradeParams& params, Worst& worst) {
  const DeepImage found = deep::grade(frame.image.copy(), params);
  const char* names[] = {"R", "G", "B"};
  worst.touch(frame.name);
  for (size_t s = 0; s < found.samples(); ++s) {
    const Real alpha = std::clamp(frame.image.get("A")[s], 0.0f, 1.0f);
    std::array<Real, 3> in;
    for (size_t c = 0; c < 3; ++c) in[c] = usable(frame.image.get(names[c])[s]);
    const Graded expected = graded(in, alpha, params);
    for (size_t c = 0; c < 3; ++c)
      worst.put(frame.name, frame.seed, s, found.get(names[c])[s], expected.colour[c], expected.scale + Real(FLT_MIN));
  }
}

TEST(StressGrade, LinearParts) {
  // Sums of up to three products in float: five roundings of half a step.
  Worst worst("grade: linear", 6 * 0x1p-24);
  forEachFrame([&](const Frame& frame) {
    checkGrade(frame, {.gain = {2, 0.5f, 1e3f}, .offset = {0.1f, -0.2f, 0}, .saturation = 0.3f}, worst);
    checkGrade(frame, {.gain = {1e-6f, 1, 7}, .saturation = 1.7f}, worst);
  });
}

TEST(StressGrade, Gamma) {
  // A float's power is good to some steps; so is its argument, whose error the power multiplies by at most 3 here.
  Worst worst("grade: gamma", 16 * 0x1p-24);
  forEachFrame([&](const Frame& frame) {
    checkGrade(frame, {.gamma = {2, 0.5f, 1}}, worst);
    checkGrade(frame, {.offset = {0, 0.1f, 0}, .gamma = {2.2f, 0.4f, 4}}, worst);
  });
}

TEST(StressGrade, OfGainsBeyondAllMeasureEndsAtTheLargest) {
  forEachFrame([](const Frame& frame) {
    for (const float saturation : {1.0f, 0.5f}) {
      const DeepImage found = deep::grade(
          frame.image.copy(), {.gain = {1e30f, 3e38f, 1e-38f}, .offset = {-1e30f, 0, 3e38f}, .saturation = saturation});
      for (const char* name : {"R", "G", "B"})
        for (const float value : found.get(name))
          EXPECT_LE(std::abs(value), 1e15f) << frame.name << ", seed " << frame.seed;
    }
  });
}

flat::Image flatColours(const Frame& frame) {
  flat::Image flat{frame.image.dataWindow, frame.image.displayWindow, {}, {}};
  for (const char* name : {"R", "G", "B", "A"}) flat.add(name);
  std::mt19937 random(frame.seed + 99);
  const float values[] = {0, 0x1p-149f, 1e-38f, 1e-20f, 0.3f, 2, 65504, 1e10f, 1e15f};
  const float alphas[] = {0, 1e-30f, 1e-7f, 0.2f, 0.9f, 1 - 0x1p-24f, 1};
  for (size_t p = 0; p < flat.dataWindow.area(); ++p) {
    for (const char* name : {"R", "G", "B"}) flat.find(name)->values[p] = values[random() % std::size(values)];
    flat.find("A")->values[p] = alphas[random() % std::size(alphas)];
  }
  return flat;
}

TEST(StressRecolour, FlattensToTheFlatColour) {
  // Each sample's colour and the sum are rounded.
  Worst colour("recolour: colour", 0x1.1p-23);
  forEachFrame([&](const Frame& frame) {
    const flat::Image flat = flatColours(frame);
    const DeepImage found = deep::recolour(frame.image.copy(), flat, {});
    colour.touch(frame.name);
    for (size_t p = 0; p < found.pixels(); ++p) {
      if (found.count(p) == 0) continue;
      const Real wanted = flat.get("G").values[p];
      colour.put(frame.name, frame.seed, p, exactPixel(found, p).light(valuesOf(found, p, "G"), kForever, true), wanted,
                 wanted + Real(FLT_MIN) * Real(found.count(p)));
    }
  });
}

TEST(StressRecolour, MattesFlattenToTheFlatAlpha) {
  Worst alpha("recolour: alpha", 0x1.1p-23), colour("recolour: colour with matte", 0x1.1p-22);
  forEachFrame([&](const Frame& frame) {
    const flat::Image flat = flatColours(frame);
    const DeepImage found = deep::recolour(frame.image.copy(), flat, {.matte = true});
    alpha.touch(frame.name), colour.touch(frame.name);
    for (size_t p = 0; p < found.pixels(); ++p) {
      if (found.count(p) == 0) continue;
      const ExactPixel exact = exactPixel(found, p);
      const Real wanted = flat.get("A").values[p];
      alpha.put(frame.name, frame.seed, p, exact.alphaOfAll(), wanted, wanted + Real(FLT_MIN) * Real(found.count(p)));
      const Real green = flat.get("G").values[p];
      colour.put(frame.name, frame.seed, p, exact.light(valuesOf(found, p, "G"), kForever, true), green,
                 green + Real(FLT_MIN) * Real(found.count(p)));
      for (const float coc : valuesOf(found, p, "coc")) EXPECT_TRUE(std::isfinite(coc));
    }
  });
}

TEST(StressExpression, IsWhatItSays) {
  // In double, then rounded.
  Worst worst("expression", 0x1.01p-24), divided("expression: unpremultiplied", 0x1.01p-24);
  forEachFrame([&](const Frame& frame) {
    const DeepImage found = deep::expression(frame.image.copy(), {.set = "G = G*0.3 + R; A = clamp(A*0.5, 0, 1)"});
    const DeepImage follow = deep::expression(frame.image.copy(), {.set = "G = G*0.3 + R", .unpremultiplied = true});
    worst.touch(frame.name), divided.touch(frame.name);
    for (size_t s = 0; s < found.samples(); ++s) {
      const Real r = frame.image.get("R")[s], g = frame.image.get("G")[s], expected = g * Real(0.3) + r;
      if (expected > Real(1e15f)) continue;  // 0, as the header says
      worst.put(frame.name, frame.seed, s, found.get("G")[s], expected, r + g + Real(FLT_MIN));
      worst.put(frame.name, frame.seed, s, found.get("A")[s], Real(frame.image.get("A")[s]) / 2,
                Real(frame.image.get("A")[s]) + Real(FLT_MIN));
      divided.put(frame.name, frame.seed, s, follow.get("G")[s], expected, r + g + Real(FLT_MIN));
    }
  });
}

TEST(StressDeepen, FlattensToTheImage) {
  Worst worst("deepen: thick", 0);
  forEachFrame([&](const Frame& frame) {
    flat::Image flat = flatColours(frame);
    std::mt19937 random(frame.seed);
    Buffer<float>& z = flat.add("Z").values;
    for (float& depth : z) depth = std::pow(10.0f, float(random() % 16) - 6);
    worst.touch(frame.name);
    for (const float thickness : {0.0f, 1e-6f, 1e9f}) {
      const flat::Image found = deep::flatten(deep::deepen(flat, {.thickness = thickness}));
      for (size_t p = 0; p < z.size(); ++p)
        for (const char* name : {"G", "A"})
          worst.put(frame.name, frame.seed, p, found.get(name).values[p], flat.get(name).values[p]);
    }
  });
}

TEST(StressDeepen, ExtinctionIsAlphaByLength) {
  Worst alpha("deepen: extinction, alpha", 0x1.1p-24), colour("deepen: extinction, colour", 0x1.1p-23);
  forEachFrame([&](const Frame& frame) {
    const flat::Image flat = flatColours(frame);
    alpha.touch(frame.name), colour.touch(frame.name);
    for (const float thickness : {1e-6f, 1.0f, 50.0f}) {
      const flat::Image found = deep::flatten(deep::deepen(flat, {.z = 3, .thickness = thickness, .extinction = true}));
      for (size_t p = 0; p < flat.dataWindow.area(); ++p) {
        const Real depth = Real(flat.get("A").values[p]) * thickness;
        const Real expected = usable(flat.get("G").values[p]) * thickness * meanPassing(depth);
        alpha.put(frame.name, frame.seed, p, found.get("A").values[p], -std::expm1(-depth),
                  -std::expm1(-depth) + FLT_MIN);
        if (expected < 1e15L)
          colour.put(frame.name, frame.seed, p, found.get("G").values[p], expected, expected + FLT_MIN);
      }
    }
  });
}

TEST(StressIds, CoverWhatIsSeenOfThem) {
  Worst matte("id mattes", 0x1.01p-24), ranked("ranked ids", 0x1.1p-24);
  forEachFrame([&](const Frame& frame) {
    const uint32_t wanted[] = {0, 3, 4};
    const flat::Image found = deep::idMatte(frame.image, "id", wanted);
    const deep::RankedIds ranks = deep::rankIds(frame.image, "id", 6);
    matte.touch(frame.name), ranked.touch(frame.name);
    for (size_t p = 0; p < frame.image.pixels(); ++p) {
      const ExactPixel exact = exactPixel(frame.image, p);
      const std::vector<Real> seen = exact.seen();
      Real sum = 0, all = 0;
      for (size_t i = 0; i < seen.size(); ++i)
        if (std::ranges::find(wanted, frame.image.find("id")->ids[frame.image.offsets[p] + i]) != std::end(wanted))
          sum += seen[i];
      // What is behind the nearly opaque is known to 2^-53 of what is in front.
      matte.put(frame.name, frame.seed, p, found.get("A").values[p], sum, sum + 1e-8L);
      float before = kInfinity;
      for (int rank = 0; rank < 6; ++rank) {
        const std::string plane = "id0" + std::to_string(rank / 2) + (rank % 2 ? ".A" : ".G");
        const float coverage = ranks.image.get(plane).values[p];
        EXPECT_LE(coverage, before);
        before = coverage;
        all += coverage;
      }
      if (ranks.most <= 6)
        ranked.put(frame.name, frame.seed, p, all, exact.alphaOfAll(), exact.alphaOfAll() + 6 * Real(FLT_MIN));
    }
  });
}

}  // namespace
}  // namespace fathom::stress
