// The network against what training's own program computed with the same weights and inputs.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "nn/compositional.h"

namespace fathom::nn {
namespace {

// FATHOM_NN_GOLDEN: a folder with tiny.safetensors, the weights, and golden.safetensors with the tensors input
// (24 x height x width), colour, statistics (of the input as one block), and output1, output2, output4 (3 x height x width), as nn/train/golden.py writes them.
TEST(CompositionalNet, EqualsTraining) {
  const char* given = std::getenv("FATHOM_NN_GOLDEN");
  const std::string folder = given ? given : "";
  if (folder.empty() || !std::filesystem::exists(folder + "/golden.safetensors"))
    GTEST_SKIP() << "skipped: FATHOM_NN_GOLDEN names no folder with golden.safetensors";
  const CompositionalNet net(readWeights(folder + "/tiny.safetensors"));
  const WeightFile golden = readWeights(folder + "/golden.safetensors");
  const Tensor& planes = golden.tensors.at("input");
  ASSERT_EQ(planes.shape.size(), 3U);
  const int height = int(planes.shape[1]), width = int(planes.shape[2]);
  WeightSource source(golden);
  source.take("input", {kInputPlanes, height, width});
  const Tensor& colour = source.take("colour", {3, height, width});
  const CompositionalInput input = {denseRows(planes.values.data(), kInputPlanes, height, width),
                                    denseRows(colour.values.data(), 3, height, width), height, width};
  const Tensor& statistics = source.take("statistics", {int64_t(kBlockStatistics)});
  const BlockStatistics found = blockStatistics(input.planes, height, width);
  for (size_t i = 0; i < kBlockStatistics; ++i) EXPECT_NEAR(found[i], statistics.values[i], 1e-5) << i;
  EXPECT_TRUE(net.gains().known());
  CompositionalNet::Workspace workspace;
  for (const int components : {1, 2, 4}) {
    const Tensor& expected = source.take("output" + std::to_string(components), {3, height, width});
    std::vector<float> result(expected.values.size());
    net.denoise(input, {0, 0, width, height}, components, denseRows(result.data(), 3, height, width), workspace);
    float most = 0;
    for (const float v : expected.values) most = std::max(most, std::fabs(v));
    ASSERT_GT(most, 0);
    for (size_t i = 0; i < result.size(); ++i)
      ASSERT_NEAR(result[i], expected.values[i], 1e-4f * most) << "K = " << components << ", value " << i;
  }
}

}  // namespace
}  // namespace fathom::nn
