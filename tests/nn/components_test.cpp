// What a block's planes come to in numbers, and the coefficients that come with weights.
#include "nn/components.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "nn/compositional_layers.h"
#include "tests/reference/compositional.h"

namespace fathom::nn {
namespace {

using ::testing::HasSubstr;

WeightFile fileOf(const std::map<std::string, std::string>& more) {
  reference::PlainWeights weights = reference::randomCompositional(16, 1);
  weights.metadata.insert(more.begin(), more.end());
  return readWeights(reference::safetensors(weights), "random");
}

std::string numbers(double first, size_t count = kBlockStatistics) {
  std::string text;
  for (size_t i = 0; i < count; ++i) text += fmt::format("{}{:f}", i ? " " : "", i ? 0.0 : first);
  return text;
}

TEST(BlockStatistics, AreMeansAndSpreads) {
  // A step in the light, grain of +-0.1 on it, and constants elsewhere.
  constexpr int kHeight = 8, kWidth = 12;
  std::vector<float> values(size_t(kInputPlanes) * kHeight * kWidth);
  for (int p = 0; p < kInputPlanes; ++p)
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        const float grain = (x + y) % 2 ? 0.1f : -0.1f, step = x < 4 ? 0.0f : 3.0f;
        values[size_t((p * kHeight + y) * kWidth + x)] = p < 3 ? step + grain : p == 4 ? step : p == 23 ? -1 : float(p);
      }
  const BlockStatistics found =
      blockStatistics(denseRows<const float>(values.data(), kInputPlanes, kHeight, kWidth), kHeight, kWidth);
  const BlockStatistics expected = {1, 11, 15, 2, std::sqrt(2.0), 0.1, std::sqrt(2.0) / 6, 13, 17, 0, -1, 1};
  for (size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-6) << i;
  std::fill(values.end() - kHeight * kWidth, values.end(), 0.0f);  // the whole light is no component
  EXPECT_EQ(blockStatistics(denseRows<const float>(values.data(), kInputPlanes, kHeight, kWidth), kHeight, kWidth)[11],
            0);
}

TEST(ComponentGains, ComeWithTheWeights) {
  EXPECT_FALSE(ComponentGains(fileOf({})).known());
  EXPECT_EQ(ComponentGains(fileOf({})).of({1}), (std::array<double, 2>{0, 0}));
  const ComponentGains gains(fileOf({{"components.gain2", numbers(0.25)}, {"components.gain4", numbers(9)}}));
  EXPECT_TRUE(gains.known());
  EXPECT_EQ(gains.of({1, 7}), (std::array<double, 2>{0.25, 0.5})) << "what no network gains is cut";
}

TEST(ComponentGains, RefuseOtherNumbers) {
  const auto message = [](const std::map<std::string, std::string>& metadata) {
    try {
      const ComponentGains gains(fileOf(metadata));
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  const std::string good = numbers(1);
  EXPECT_EQ(message({{"components.gain2", good}}), "random: metadata components.gain4 is missing");
  EXPECT_EQ(message({{"components.gain4", good}}), "random: metadata components.gain2 is missing");
  for (const std::string& bad : {std::string(), std::string("1 2 3"), numbers(1, 11), good + " 1", good + "x",
                                 fmt::format("nan{}", good.substr(8)), fmt::format("1e999{}", good.substr(8)),
                                 fmt::format("1,5{}", good.substr(8))})
    EXPECT_THAT(message({{"components.gain2", bad}, {"components.gain4", good}}),
                HasSubstr("random, metadata components.gain2: expected 12 numbers, found"))
        << bad;
  EXPECT_EQ(message({{"components.gain2", fmt::format("  {}", good)}, {"components.gain4", good}}), "accepted");
}

}  // namespace
}  // namespace fathom::nn
