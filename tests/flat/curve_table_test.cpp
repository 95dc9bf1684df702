// Tables are true to smooth functions everywhere, and there is none of others.
#include "flat/curve_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/reference/simd_targets.h"

namespace fathom::flat {
namespace {

constexpr float kTolerance = 0.2f / 255;

template <class Function>
std::optional<CurveTable> tableOf(const Function& function) {
  return CurveTable::make(
      [&](std::span<float> values) {
        for (float& value : values) value = float(function(double(value)));
      },
      kTolerance);
}

template <class Function>
void expectTrue(const Function& function) {
  const std::optional<CurveTable> table = tableOf(function);
  ASSERT_TRUE(table);
  std::mt19937 random(7);
  std::uniform_real_distribution<float> octave(-40, 16), sign(-1, 1);
  const auto check = [&](float x) {
    const double expected = std::clamp(function(double(x)), 0.0, 1.0);
    ASSERT_NEAR((*table)(x), expected, 2 * kTolerance) << x;
  };
  for (int i = 0; i < 100000; ++i)
    check(std::copysign(std::min(std::exp2(octave(random)), CurveTable::kMost), sign(random)));
  for (const float x : {0.0f, -0.0f, CurveTable::kMost, -CurveTable::kMost, std::numeric_limits<float>::denorm_min()})
    check(x);
}

double srgb(double x) {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

TEST(CurveTable, IsTrueToCurvesThatScreensHave) {
  expectTrue(srgb);
  expectTrue([](double x) { return x; });
  expectTrue([](double x) { return std::pow(std::max(0.0, x), 1 / 2.4); });
  expectTrue([](double x) { return std::pow(std::max(0.0, x), 3.0); });
  expectTrue([](double x) { return 0.5 + std::cbrt(x) / 10; });                      // negative values, too
  expectTrue([](double x) { return (std::log2(std::max(x, 0x1p-16)) + 16) / 24; });  // a log with its floor
  expectTrue([](double x) { return std::min(1.3 * x, 0.8); });                       // a kink
}

TEST(CurveTable, ThereIsNoneOfWhatJumpsOrIsNoNumber) {
  EXPECT_FALSE(tableOf([](double x) { return x > 0.3 ? 1.0 : 0.0; }));
  EXPECT_FALSE(tableOf([](double x) { return std::pow(std::abs(x), 0.02); }));
  EXPECT_FALSE(tableOf([](double x) { return std::sqrt(x); }));  // of negative numbers
  EXPECT_FALSE(tableOf([](double x) { return 0.5 + std::sin(1000 * x); }));
}

// All instruction sets give what one number after the other does, wherever rows begin and end.
TEST(CurveTable, PixelsAreTheNumbersOfTheirChannels) {
  const auto red = *tableOf(srgb), green = *tableOf([](double x) { return 1 - x; }),
             blue = *tableOf([](double x) { return x * x; });
  std::mt19937 random(11);
  std::uniform_real_distribution<float> octave(-40, 16), sign(-1, 1);
  std::vector<float> values(300);
  for (size_t i = 0; i < values.size(); ++i) {  // every second one where screens are neither black nor white
    const float size = std::exp2(i % 2 ? octave(random) : octave(random) / 16 - 1);
    values[i] = std::copysign(std::min(size, CurveTable::kMost), sign(random));
  }
  values[3] = 0;
  values[5] = -CurveTable::kMost;
  const auto step = [](const CurveTable& table, float x) { return uint32_t(std::floor(table(x) * 255 + 0.5f)); };
  forSimdTargets([&] {
    for (size_t first = 0; first < 5; ++first)
      for (size_t count = 0; count < 40; ++count) {
        std::vector<uint32_t> pixels(count + 1, 7);
        const float* r = values.data() + first;
        lookUpPixels({&red, &green, &blue}, {r, r + 100, r + 200}, count, pixels.data());
        for (size_t x = 0; x < count; ++x)
          ASSERT_EQ(pixels[x],
                    0xff000000u | step(red, r[x]) << 16 | step(green, r[100 + x]) << 8 | step(blue, r[200 + x]));
        ASSERT_EQ(pixels[count], 7u);
      }
  });
}

}  // namespace
}  // namespace fathom::flat
