// The mixing network against its double-precision twin and its training's program, and laws of it.
#include "nn/mix.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "base/error.h"
#include "tests/reference/mix_net.h"

namespace fathom::nn {
namespace {

using reference::MixTwinLogits;
using reference::PlainWeights;
using reference::randomMix;
using reference::randomVolume;
using reference::Volume;
using testing::HasSubstr;

WeightFile fileOf(const PlainWeights& weights) {
  return readWeights(reference::safetensors(weights), "random");
}

// What a network takes of planes that lie in memory.
MixSource sourceOf(const std::vector<ConstPlanes>& own, const ConstPlanes& shared, int height, int width) {
  const auto copy = [height, width](const ConstPlanes& from, const Window& window, const Planes& to) {
    for (size_t p = 0; p < from.plane.size(); ++p)
      for (int y = 0; y < window.height; ++y)
        for (int x = 0; x < window.width; ++x)
          to.row(p, y)[x] = from.row(p, std::min(window.y + y, height - 1))[std::min(window.x + x, width - 1)];
  };
  return {.candidates = int(own.size()),
          .height = height,
          .width = width,
          .shared = [=](const Window& window, const Planes& to) { copy(shared, window, to); },
          .own = [=](int n, const Window& window, const Planes& to) { copy(own[size_t(n)], window, to); }};
}

struct Frame {
  int height, width;
  Volume shared;
  std::vector<Volume> own;
  std::vector<float> sharedValues;
  std::vector<std::vector<float>> ownValues;

  Frame(int candidates, int h, int w) : height(h), width(w), shared(randomVolume(kMixShared, h, w, 9, -1, 1)) {
    sharedValues = floatsOf(shared);
    for (int n = 0; n < candidates; ++n) {
      own.push_back(randomVolume(kMixOwn, h, w, uint32_t(20 + n), -1, 1));
      ownValues.push_back(floatsOf(own.back()));
    }
  }

  MixSource source(std::vector<size_t> order = {}) const {
    for (size_t n = 0; order.size() < own.size(); ++n) order.push_back(n);
    std::vector<ConstPlanes> planes;
    for (const size_t n : order) planes.push_back(denseRows<const float>(ownValues[n].data(), kMixOwn, height, width));
    return sourceOf(planes, denseRows<const float>(sharedValues.data(), kMixShared, height, width), height, width);
  }
};

void expectNear(const Buffer<float>& found, const Volume& expected) {
  double most = 0;
  for (const double v : expected.values) most = std::max(most, std::abs(v));
  ASSERT_GT(most, 0.1);
  ASSERT_EQ(found.size(), expected.values.size());
  for (size_t i = 0; i < found.size(); ++i) ASSERT_NEAR(found[i], expected.values[i], 1e-4 * most) << i;
}

// More than one tile in a row and in a column, and a height and a width that end in the middle of the coarsest pixels' reach.
TEST(MixNet, EqualsItsTwin) {
  const PlainWeights weights = randomMix(1);
  const MixNet net(fileOf(weights));
  for (const int candidates : {1, 2, 3}) {
    const Frame frame(candidates, candidates == 1 ? 292 : 36, candidates == 2 ? 292 : 40);
    const MixTwinLogits expected = reference::mixTwin(weights, frame.own, frame.shared);
    const MixLogits found = net.run(frame.source());
    expectNear(found.share, expected.share);
    for (size_t n = 0; n < size_t(candidates); ++n) expectNear(found.weight[n], expected.weight[n]);
  }
}

TEST(MixNet, KnowsNoOrder) {
  const MixNet net(fileOf(randomMix(2)));
  const Frame frame(3, 20, 24);
  const MixLogits one = net.run(frame.source()), other = net.run(frame.source({2, 0, 1}));
  const size_t from[] = {2, 0, 1};
  for (size_t i = 0; i < one.share.size(); ++i) {
    ASSERT_NEAR(one.share[i], other.share[i], 1e-5);
    for (size_t n = 0; n < 3; ++n) ASSERT_NEAR(one.weight[from[n]][i], other.weight[n][i], 1e-5);
  }
}

TEST(MixNet, HasTheSameBitsForAnyNumberOfThreads) {
  const MixNet net(fileOf(randomMix(3)));
  const Frame frame(2, 270, 530);
  const MixLogits many = net.run(frame.source());
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  const MixLogits one = net.run(frame.source());
  EXPECT_TRUE(std::ranges::equal(many.share, one.share));
  for (size_t n = 0; n < 2; ++n) EXPECT_TRUE(std::ranges::equal(many.weight[n], one.weight[n]));
}

// A frame whose sides are no multiples of 4 is one whose last pixels are repeated.
TEST(MixNet, TakesAnySize) {
  const MixNet net(fileOf(randomMix(4)));
  for (const auto& [height, width] : {std::pair(1, 1), std::pair(3, 17), std::pair(22, 5)}) {
    const MixLogits found = net.run(Frame(2, height, width).source());
    ASSERT_EQ(found.share.size(), size_t(height) * size_t(width));
    for (const float v : found.share) ASSERT_TRUE(std::isfinite(v));
  }
}

TEST(MixNet, WorksInNoMoreThanItSays) {
  const MixNet net(fileOf(randomMix(5)));
  EXPECT_LT(net.bytesPerThread(3), size_t(100'000'000));
  EXPECT_LT(net.flopPerPixel(), 17e3);
}

TEST(MixNet, RefusesOtherFiles) {
  const auto expectError = [](const PlainWeights& weights, const char* text) {
    try {
      const MixNet net(fileOf(weights));
      FAIL() << "expected an error: " << text;
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), HasSubstr(text));
    }
  };
  PlainWeights weights = randomMix(6);
  weights.metadata["format"] = "fathom-compositional";
  expectError(weights, "metadata format: expected fathom-mix, found fathom-compositional");
  weights = randomMix(6);
  weights.metadata["version"] = "2";
  expectError(weights, "metadata version: expected 1, found 2");
  weights = randomMix(6);
  weights.tensors.erase("merge1.weight");
  expectError(weights, "merge1.weight");
  weights = randomMix(6);
  weights.tensors["more"] = weights.tensors["share.bias"];
  expectError(weights, "more");
  weights = randomMix(6);
  weights.tensors["own.weight"].shape = {16, 8, 2, 1};
  expectError(weights, "own.weight");
}

TEST(MixNet, Stops) {
  const MixNet net(fileOf(randomMix(7)));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(net.run(Frame(1, 8, 8).source(), {{}, stop.get_token()}), Cancelled);
}

// FATHOM_NN_GOLDEN: a folder with mix.safetensors and mix_golden.safetensors, as nn/train/mix_export.py writes them.
TEST(MixNet, EqualsTraining) {
  const char* given = std::getenv("FATHOM_NN_GOLDEN");
  const std::string folder = given ? given : "";
  if (folder.empty() || !std::filesystem::exists(folder + "/mix_golden.safetensors"))
    GTEST_SKIP() << "skipped: FATHOM_NN_GOLDEN names no folder with mix_golden.safetensors";
  const MixNet net(readWeights(folder + "/mix.safetensors"));
  const WeightFile golden = readWeights(folder + "/mix_golden.safetensors");
  const Tensor &shared = golden.tensors.at("shared"), &own = golden.tensors.at("own");
  ASSERT_EQ(own.shape.size(), 4U);
  const int candidates = int(own.shape[0]), height = int(own.shape[2]), width = int(own.shape[3]);
  const size_t pixels = size_t(height) * size_t(width);
  std::vector<ConstPlanes> planes;
  for (int n = 0; n < candidates; ++n)
    planes.push_back(denseRows<const float>(own.values.data() + kMixOwn * pixels * size_t(n), kMixOwn, height, width));
  const MixLogits found =
      net.run(sourceOf(planes, denseRows<const float>(shared.values.data(), kMixShared, height, width), height, width));
  const auto expectEqual = [](const Buffer<float>& a, const float* b) {
    float most = 0;
    for (size_t i = 0; i < a.size(); ++i) most = std::max(most, std::fabs(b[i]));
    ASSERT_GT(most, 0);
    for (size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1e-4f * most) << i;
  };
  expectEqual(found.share, golden.tensors.at("share").values.data());
  for (int n = 0; n < candidates; ++n)
    expectEqual(found.weight[size_t(n)], golden.tensors.at("weight").values.data() + pixels * size_t(n));
}

}  // namespace
}  // namespace fathom::nn
