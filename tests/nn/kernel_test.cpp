// The kernels against their twins, on every instruction set and for all tails.
#include <gtest/gtest.h>

#include <cmath>

#include "nn/blocked.h"
#include "nn/colour_kernel.h"
#include "nn/kernel_filter.h"
#include "tests/reference/kernel_planes.h"
#include "tests/reference/layers.h"
#include "tests/reference/simd_targets.h"

namespace fathom::nn {
namespace {

using reference::bordered;
using reference::grouped;
using reference::randomVolume;
using reference::Volume;

constexpr std::pair<int, int> kSizes[] = {{1, 1},  {1, 2},  {2, 1},  {3, 5},  {4, 7},  {2, 8}, {5, 15},
                                          {3, 16}, {2, 17}, {3, 31}, {2, 32}, {1, 33}, {7, 50}};

TEST(NnKernels, FilterEqualsItsTwin) {
  forSimdTargets([] {
    for (const int block : {8, 16})
      for (const auto& [height, width] : kSizes) {
        const Volume logits = randomVolume(26, height, width, 1, -6, 6),
                     colour = randomVolume(3, height, width, 2, 0, 4);
        const Volume expected = reference::filterColour(logits, colour);
        const Volume expectedAlpha = reference::sigmoid(reference::channel(logits, 25));
        const Buffer<float> values = grouped(logits, block, 32 / block, 1e30f);
        std::vector<float> filtered(colour.values.size()), alpha(size_t(height * width));
        filterColour(values.data(), block, bordered(colour), denseRows(filtered.data(), 3, height, width),
                     alpha.data());
        for (size_t i = 0; i < filtered.size(); ++i) ASSERT_NEAR(filtered[i], expected.values[i], 3e-6);
        for (size_t i = 0; i < alpha.size(); ++i) ASSERT_NEAR(alpha[i], expectedAlpha.values[i], 1e-6);
        std::vector<float> again(colour.values.size());
        filterColour(values.data(), block, bordered(colour), denseRows(again.data(), 3, height, width), nullptr);
        ASSERT_EQ(again, filtered);
      }
  });
}

TEST(NnKernels, FilterIsFiniteForLargeLogits) {
  forSimdTargets([] {
    Volume logits(26, 2, 19);
    for (size_t i = 0; i < logits.values.size(); ++i) logits.values[i] = i % 7 == 0 ? 1e30 : i % 5 == 0 ? -1e30 : 80;
    const Volume colour = randomVolume(3, 2, 19, 2, 0, 4);
    std::vector<float> filtered(colour.values.size()), alpha(2 * 19);
    filterColour(grouped(logits, 16, 2, 0).data(), 16, bordered(colour), denseRows(filtered.data(), 3, 2, 19),
                 alpha.data());
    for (const float v : filtered) ASSERT_TRUE(v >= 0 && v <= 4.0001f) << v;
    for (const float v : alpha) ASSERT_TRUE(v >= 0 && v <= 1) << v;
  });
}

TEST(NnKernels, HalveAndAddCoarseEqualTheirTwins) {
  forSimdTargets([] {
    for (const auto& [halfHeight, halfWidth] : kSizes) {
      const int height = 2 * halfHeight, width = 2 * halfWidth;
      const Volume fine = randomVolume(3, height, width, 1, 0, 4), alpha = randomVolume(1, height, width, 2, 0, 1);
      const Volume coarse = randomVolume(3, halfHeight, halfWidth, 3, 0, 4);
      std::vector<float> values = floatsOf(fine), half(coarse.values.size()), coarseValues = floatsOf(coarse);
      halve(denseRows<const float>(values.data(), 3, height, width), height, width,
            denseRows(half.data(), 3, halfHeight, halfWidth));
      const Volume expectedHalf = reference::halve(fine);
      for (size_t i = 0; i < half.size(); ++i) ASSERT_NEAR(half[i], expectedHalf.values[i], 1e-6);
      addCoarse(denseRows(values.data(), 3, height, width), height, width, floatsOf(alpha).data(),
                denseRows(coarseValues.data(), 3, halfHeight, halfWidth));
      const Volume expected = reference::addCoarse(fine, alpha, coarse);
      for (size_t i = 0; i < values.size(); ++i) ASSERT_NEAR(values[i], expected.values[i], 3e-6);
    }
  });
}

TEST(NnKernels, PackEqualsItsTwin) {
  forSimdTargets([] {
    for (const int block : {8, 16})
      for (const int channels : {1, 3, 8, 16, 17, 24})
        for (const auto& [height, width] : kSizes) {
          const Volume volume = randomVolume(channels, height, width, 1, -2, 2);
          const std::vector<float> values = floatsOf(volume);
          const int groups = (channels + block - 1) / block;
          const Buffer<float> expected = grouped(volume, block, groups, 0);
          const ConstPlanes planes = denseRows(values.data(), channels, height, width);
          Buffer<float> packed(expected.size());
          packPlanes(planes, height, width, block, Element::float32, reinterpret_cast<std::byte*>(packed.data()));
          Buffer<uint16_t> halves(expected.size()), expectedHalves(expected.size());
          toBfloat16(expected.data(), expected.size(), expectedHalves.data());
          packPlanes(planes, height, width, block, Element::bfloat16, reinterpret_cast<std::byte*>(halves.data()));
          for (size_t i = 0; i < expected.size(); ++i) {
            ASSERT_EQ(packed[i], expected[i]);
            ASSERT_EQ(halves[i], expectedHalves[i]);
          }
        }
  });
}

TEST(NnKernels, Bfloat16RoundsToTheNearest) {
  const float from[] = {1, -1, 1 + 1.0f / 256, 1 + 3.0f / 256, 1 + 1.1f / 256, 0, -0.0f, 1e-45f};
  const uint16_t expected[] = {0x3f80, 0xbf80, 0x3f80, 0x3f82, 0x3f81, 0, 0x8000, 0};
  uint16_t to[8];
  toBfloat16(from, 8, to);
  for (size_t i = 0; i < 8; ++i) EXPECT_EQ(to[i], expected[i]) << from[i];
}

TEST(NnKernels, LogarithmsAndSplitEqualTheirTwins) {
  forSimdTargets([] {
    for (const auto& [height, width] : kSizes) {
      const size_t pixels = size_t(height * width);
      Volume colour = randomVolume(3, height, width, 1, 0, 5);
      colour.values[0] = 0;
      if (pixels > 3) colour.values[1] = 1e-7f, colour.values[2] = 1e6f;
      const std::vector<float> values = floatsOf(colour);
      std::vector<float> logarithms(values.size());
      logColour(values.data(), values.size(), Element::float32, reinterpret_cast<std::byte*>(logarithms.data()));
      std::vector<uint16_t> halves(values.size()), expected(values.size());
      logColour(values.data(), values.size(), Element::bfloat16, reinterpret_cast<std::byte*>(halves.data()));
      toBfloat16(logarithms.data(), values.size(), expected.data());
      ASSERT_EQ(halves, expected);
      for (size_t i = 0; i < values.size(); ++i)
        ASSERT_NEAR(logarithms[i], std::log1p(double(values[i])), 1e-6 * std::log1p(double(values[i])));
      for (const int block : {8, 16}) {
        const Volume logits = randomVolume(3, height, width, 2, -5, 5), mask = reference::sigmoid(logits);
        std::vector<float> first(values.size()), second(values.size());
        splitColour(grouped(logits, block, 1, 1e30f).data(), block, values.data(), pixels, first.data(), second.data());
        for (size_t i = 0; i < values.size(); ++i) {
          const double scale = 1e-6 * std::max(1.0, colour.values[i]);
          ASSERT_NEAR(first[i], mask.values[i] * colour.values[i], scale);
          ASSERT_NEAR(second[i], (1 - mask.values[i]) * colour.values[i], scale);
        }
      }
    }
  });
}

TEST(NnKernels, CropAndEnlargeMoveWholePixels) {
  for (const size_t pixelBytes : {size_t(16), size_t(32), size_t(64)}) {
    constexpr int kGroups = 2, kHeight = 3, kWidth = 5;
    std::vector<std::byte> from(kGroups * kHeight * kWidth * pixelBytes);
    for (size_t i = 0; i < from.size(); ++i) from[i] = std::byte(i * 37 >> 3 & 255);
    const auto pixel = [&](const std::vector<std::byte>& image, int width, int height, int g, int y, int x) {
      const size_t at = size_t((g * height + y) * width + x) * pixelBytes;
      return std::vector<std::byte>(image.begin() + ptrdiff_t(at), image.begin() + ptrdiff_t(at + pixelBytes));
    };
    const Window window = {1, 1, 3, 2};
    std::vector<std::byte> cropped(kGroups * 6 * pixelBytes), enlarged(4 * from.size());
    cropGroups(from.data(), kGroups, kHeight, kWidth, pixelBytes, window, cropped.data());
    enlargeGroups(from.data(), kGroups, kHeight, kWidth, pixelBytes, enlarged.data());
    for (int g = 0; g < kGroups; ++g) {
      for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 3; ++x)
          ASSERT_EQ(pixel(cropped, 3, 2, g, y, x), pixel(from, kWidth, kHeight, g, y + 1, x + 1));
      for (int y = 0; y < 2 * kHeight; ++y)
        for (int x = 0; x < 2 * kWidth; ++x)
          ASSERT_EQ(pixel(enlarged, 2 * kWidth, 2 * kHeight, g, y, x), pixel(from, kWidth, kHeight, g, y / 2, x / 2));
    }
  }
}

}  // namespace
}  // namespace fathom::nn
