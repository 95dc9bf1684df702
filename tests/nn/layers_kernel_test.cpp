// The layered denoiser's kernels against their twins, on every instruction set and for all tails.
#include "nn/layers_kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "nn/kernel_filter.h"
#include "nn/layers_graphs.h"
#include "tests/reference/kernel_planes.h"
#include "tests/reference/layers.h"
#include "tests/reference/simd_targets.h"

namespace fathom::nn {
namespace {

using reference::grouped;
using reference::randomVolume;
using reference::splatted;
using reference::Volume;
using reference::wide;

constexpr std::pair<int, int> kSizes[] = {{1, 1},  {1, 2},  {2, 1},  {3, 5},  {4, 7},  {6, 8}, {5, 15},
                                          {3, 16}, {2, 17}, {3, 31}, {2, 32}, {1, 33}, {7, 50}};

void expectNear(const WidePlanes& planes, const Volume& expected, double bound) {
  for (int c = 0; c < expected.channels; ++c)
    for (int y = 0; y < expected.height; ++y)
      for (int x = 0; x < expected.width; ++x) {
        const double e = expected.at(c, y, x);
        ASSERT_NEAR(planes.row(size_t(c), y)[x], e, bound * std::max(1.0, std::fabs(e))) << c << ", " << y << ", " << x;
      }
}

TEST(LayerKernels, SplatEqualsItsTwin) {
  forSimdTargets([] {
    WidePlanes result, shares;  // kept: what an image leaves behind must not matter to the next
    for (const auto& [block, divided] : {std::pair(8, false), {16, false}, {8, true}, {16, true}})
      for (const auto& [height, width] : kSizes) {
        const Volume logits = randomVolume(28, height, width, 1, -3, 3);
        const Volume values = randomVolume(divided ? 12 : 6, height, width, 2, 0, 2);
        const Buffer<float> grouped32 = grouped(logits, block, 32 / block, 1e30f);
        splat(grouped32.data(), block, wide(values), divided, result, &shares);
        expectNear(result, splatted(logits, values), 1e-5);
        Volume lambda(3, height, width);
        for (int i = 0; i < height * width; ++i) {
          const int y = i / width, x = i % width;
          double total = 0;
          for (int c = 0; c < 3; ++c) total += lambda.at(c, y, x) = std::exp(logits.at(25 + c, y, x));
          for (int c = 0; c < 3; ++c) lambda.at(c, y, x) /= total;
        }
        expectNear(shares, lambda, 1e-6);
        splat(grouped32.data(), block, wide(values), divided, result, nullptr);
        expectNear(result, splatted(logits, values), 1e-5);
      }
  });
}

TEST(LayerKernels, SplatClampsLogitsAndIsFiniteWithoutWeights) {
  forSimdTargets([] {
    Volume logits(28, 3, 19), values(6, 3, 19);
    for (size_t i = 0; i < logits.values.size(); ++i)
      logits.values[i] = i % 7 == 0 ? 1e30 : i % 5 == 0 ? -1e30 : i % 3 == 0 ? 80 : 11.3;
    WidePlanes result, shares;
    const Buffer<float> grouped32 = grouped(logits, 16, 2, 0);
    splat(grouped32.data(), 16, wide(values), false, result, &shares);
    expectNear(result, Volume(5, 3, 19), 0);
    for (size_t i = 4 * 3 * 19; i < 5 * 3 * 19; ++i) values.values[i] = 1;
    values.at(0, 1, 9) = values.at(3, 1, 9) = 1;
    splat(grouped32.data(), 16, wide(values), false, result, &shares);
    expectNear(result, splatted(logits, values), 1e-5);
  });
}

TEST(LayerKernels, SharesEqualTheirTwin) {
  forSimdTargets([] {
    for (const int block : {8, 16})
      for (const int layers : {2, 4})
        for (const size_t count : {1, 7, 8, 15, 16, 17, 33, 100}) {
          const Volume logits = randomVolume(4, 1, int(count), 3, -8, 8);
          const size_t stride = count + 64;
          Buffer<float> shares(size_t(layers) * stride, -1.0f);
          layerShares(grouped(logits, block, 1, 1e30f).data(), block, count, layers, shares.data(), stride);
          for (size_t i = 0; i < count; ++i) {
            double total = 0, rest = 0, q[4];
            for (int l = 0; l < layers; ++l) total += q[l] = std::exp(logits.at(l, 0, int(i)));
            for (int l = 0; l < layers; ++l) rest += q[l] = std::max(q[l] / total - 0.01, 0.0);
            for (int l = 0; l < layers; ++l) {
              ASSERT_NEAR(shares[size_t(l) * stride + i], q[l] / rest, 1e-5);
              if (q[l] == 0) {
                ASSERT_EQ(shares[size_t(l) * stride + i], 0);
              }
            }
          }
        }
  });
}

TEST(LayerKernels, SumsEqualTheirTwins) {
  forSimdTargets([] {
    for (const int block : {8, 16}) {
      constexpr size_t kCount = 37, kPixels = 11;
      const int groups = 32 / block;
      const Volume values = randomVolume(32, 1, kCount, 5, -1, 1);
      std::mt19937 generator(6);
      std::vector<float> weight;
      std::vector<uint32_t> pixel;
      for (size_t i = 0; i < kCount; ++i) {
        weight.push_back(i % 5 ? float(generator() % 100) / 100 : 0);
        pixel.push_back(uint32_t(i * kPixels / kCount));
      }
      Volume expected(32, 1, kPixels);
      for (int c = 0; c < 32; ++c)
        for (size_t i = 0; i < kCount; ++i)
          expected.at(c, 0, int(pixel[i])) += double(weight[i]) * values.at(c, 0, int(i));
      Buffer<float> sums(32 * kPixels, 0.0f);
      addWeighted(grouped(values, block, groups, 0).data(), kCount * size_t(block), groups, block, weight.data(),
                  pixel.data(), kCount, sums.data(), kPixels * size_t(block));
      const Buffer<float> wanted = grouped(expected, block, groups, 0);
      for (size_t i = 0; i < sums.size(); ++i) ASSERT_NEAR(sums[i], wanted[i], 1e-5);

      for (const auto& [halfHeight, halfWidth] : kSizes) {
        const Volume fine = randomVolume(32, 2 * halfHeight, 2 * halfWidth, 7, -1, 1);
        Buffer<float> half(size_t(32 * halfHeight * halfWidth));
        halveGroups(grouped(fine, block, groups, 0).data(), groups, 2 * halfHeight, 2 * halfWidth, block, half.data());
        const Buffer<float> mean = grouped(reference::halve(fine), block, groups, 0);
        for (size_t i = 0; i < half.size(); ++i) ASSERT_NEAR(half[i], mean[i], 1e-6);
      }
    }
  });
}

TEST(LayerKernels, EnlargedPlanesAreAdded) {
  forSimdTargets([] {
    for (const auto& [halfHeight, halfWidth] : kSizes) {
      const int height = 2 * halfHeight, width = 2 * halfWidth;
      const Volume fine = randomVolume(5, height, width, 1, 0, 4), factor = randomVolume(1, height, width, 2, 0, 1),
                   coarse = randomVolume(5, halfHeight, halfWidth, 3, 0, 4), up = reference::enlarge(coarse);
      WidePlanes scaled;
      scaleRows(wide(factor), wide(fine), 5, scaled);
      Volume expected(5, height, width);
      for (int c = 0; c < 5; ++c)
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x)
            expected.at(c, y, x) = factor.at(0, y, x) * (fine.at(c, y, x) + up.at(c, y, x));
      const WidePlanes factors = wide(factor), small = wide(coarse);
      addEnlarged(scaled.planes(5), height, width, factors.row(0, 0), factors.stride(), small.planes(5));
      expectNear(scaled, expected, 1e-6);
    }
  });
}

}  // namespace
}  // namespace fathom::nn
