// The whole network against its double-precision twin, tiles against the whole, and threads against one.
#include "nn/compositional.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "base/error.h"
#include "nn/tiles.h"
#include "tests/reference/random_planes.h"

namespace fathom::nn {
namespace {

using reference::CompositionalTwin;
using reference::fileOf;
using reference::Frame;
using reference::largest;
using reference::largestDifference;
using reference::PlainWeights;
using reference::randomCompositional;
using reference::small;
using reference::tiled;
using reference::Volume;
using reference::whole;

TEST(CompositionalNet, EqualsItsTwin) {
  for (const int width : {16, 32}) {
    const PlainWeights weights = randomCompositional(width, 1);
    const CompositionalNet net(fileOf(weights));
    ASSERT_EQ(net.width(), width);
    for (const auto& [height, length] : {std::pair(4, 4), std::pair(12, 20), std::pair(20, 8)}) {
      if (width == 32 && length != 20) continue;
      const Frame frame(height, length, 7);
      for (const int components : {1, 2, 4}) {
        const Volume expected = CompositionalTwin(weights).denoise(frame.planes, frame.colour, components);
        const std::vector<float> result = whole(net, frame, components);
        EXPECT_LT(largestDifference(result, expected.values), 1e-4 * largest(expected.values))
            << width << " wide, " << height << "x" << length << ", K = " << components;
      }
    }
  }
}

TEST(CompositionalNet, IsCloseInBfloat16) {
  if (!machineHasBfloat16()) GTEST_SKIP() << "skipped: no bfloat16 on this processor";
  const PlainWeights weights = randomCompositional(16, 1);
  const CompositionalNet net(fileOf(weights), Precision::bfloat16);
  const Frame frame(20, 24, 7);
  for (const int components : {1, 2, 4}) {
    const Volume expected = CompositionalTwin(weights).denoise(frame.planes, frame.colour, components);
    const std::vector<float> result = whole(net, frame, components);
    EXPECT_LT(largestDifference(result, expected.values), 0.05 * largest(expected.values));
    EXPECT_GT(largestDifference(result, expected.values), 1e-5 * largest(expected.values));
  }
}

TEST(CompositionalNet, KeepsAColourThatIsTheSameEverywhere) {
  // Kernels sum to 1.
  const CompositionalNet net(fileOf(randomCompositional(16, 3)));
  Frame frame(16, 16, 5);
  std::fill(frame.colourValues.begin(), frame.colourValues.end(), 0.7f);
  for (const float v : whole(net, frame, 1)) ASSERT_NEAR(v, 0.7f, 1e-5f);
}

TEST(CompositionalNet, CountsItsArithmetic) {
  const CompositionalNet net(fileOf(randomCompositional(16, 1)));
  // Multiplications per pixel of the encoder, of what is between its features and y0, y1, x2, and of what follows.
  const double encoder = 24 * 16 * 9 + 2 * 16 * 16 * 9;
  const double unet = 16 * 16 * 9 + 3 * 16 * 9 + 2 * 16 * 16 * 9 + 16 * 32 * 4 / 4.0 + 2 * 32 * 32 * 9 / 4.0 +
                      32 * 64 * 4 / 16.0 + 2 * 64 * 64 * 9 / 16.0 + 64 * 32 / 16.0 + 64 * 32 * 9 / 4.0 + 32 * 16 / 4.0 +
                      32 * 16 * 9;
  const double denoise = unet + 16 * 26 + 32 * 26 / 4.0 + 64 * 25 / 16.0;
  const double decompose = unet + 16 * 3 + 4 * 16 * 16 * 9;
  EXPECT_DOUBLE_EQ(net.flopPerPixel(1), 2 * (encoder + denoise));
  EXPECT_DOUBLE_EQ(net.flopPerPixel(2), 2 * (encoder + decompose + 2 * denoise));
  EXPECT_DOUBLE_EQ(net.flopPerPixel(4), 2 * (encoder + 3 * decompose + 4 * denoise));
}

TEST(Tiles, EqualTheWhole) {
  const CompositionalNet net(fileOf(randomCompositional(16, 4)));
  const Frame frame(200, 148, 9);
  for (const int components : {1, 2, 4}) {
    ASSERT_GE(planTiles(net, 200, 148, small(components)).size(), 6U);
    const std::vector<float> expected = whole(net, frame, components);
    const std::vector<float> result = tiled(net, frame, small(components));
    EXPECT_LT(largestDifference(result, expected), 1e-5 * largest(expected)) << "K = " << components;
  }
}

TEST(Tiles, AreTheSameForAnyNumberOfThreads) {
  const CompositionalNet net(fileOf(randomCompositional(16, 4)));
  const Frame frame(200, 148, 9);
  std::vector<float> results[2];
  for (const size_t threads : {1, 2}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    results[threads - 1] = tiled(net, frame, small(2));
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], tiled(net, frame, small(2)));
}

TEST(Tiles, AreSkippedWhereThereIsNothingToDo) {
  const CompositionalNet net(fileOf(randomCompositional(16, 4)));
  const Frame frame(128, 128, 9);
  const std::vector<float> all = tiled(net, frame, small(1));
  const std::vector<float> some =
      tiled(net, frame, small(1), [](const Window& block) { return BlockWorth{.work = block.x > 0}; });
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 128; ++y)
      for (int x = 0; x < 128; ++x) {
        const size_t i = size_t((c * 128 + y) * 128 + x);
        ASSERT_EQ(some[i], x < kBlock ? -1.0f : all[i]);
      }
}

TEST(Tiles, HaveComponentsOfTheirOwn) {
  const CompositionalNet net(fileOf(randomCompositional(16, 4)));
  const Frame frame(64, 512, 9);
  const TileParams open = {.least = 1, .most = 4};
  const auto worth = [](const Window& block) { return BlockWorth{.gain = {0, block.x < 256 ? 0.0 : 0.5}}; };
  const std::vector<Tile> tiles = planTiles(net, 64, 512, open, worth);
  EXPECT_EQ(tiles, (std::vector<Tile>{{{0, 0, 256, 64}, 1}, {{256, 0, 256, 64}, 4}}));
  const std::vector<float> mixed = tiled(net, frame, open, worth);
  const std::vector<float> one = whole(net, frame, 1), four = whole(net, frame, 4);
  for (size_t i = 0; i < mixed.size(); ++i)
    ASSERT_NEAR(mixed[i], i % 512 < 256 ? one[i] : four[i], 1e-5 * largest(four)) << i;
}

TEST(Tiles, ReportAndStop) {
  const CompositionalNet net(fileOf(randomCompositional(16, 4)));
  const Frame frame(128, 128, 9);
  double last = 0;
  Progress progress;
  progress.report = [&](double done) {
    EXPECT_GE(done, last);
    last = done;
  };
  tiled(net, frame, small(1), {}, progress);
  EXPECT_DOUBLE_EQ(last, 1);
  last = 0;
  tiled(
      net, frame, small(1), [](const Window&) { return BlockWorth{.work = false}; }, progress);
  EXPECT_EQ(last, 1);

  std::stop_source source;
  int after = 0;
  Progress stopped{[&](double done) {
                     if (done > 0) source.request_stop();
                     after += source.stop_requested();
                   },
                   source.get_token()};
  EXPECT_THROW(tiled(net, frame, small(1), {}, stopped), Cancelled);
  EXPECT_EQ(after, 1);
}

TEST(CompositionalNet, RefusesOtherFiles) {
  const auto message = [](const auto& change) {
    PlainWeights weights = randomCompositional(16, 1);
    change(weights);
    try {
      const CompositionalNet net(fileOf(weights));
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(message([](PlainWeights&) {}), "accepted");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata.erase("format"); }), "random: metadata format is missing");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["version"] = "1"; }),
            "random, metadata version: expected 2, found 1");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["inputs"] = "23"; }),
            "random, metadata inputs: expected 24, found 23");
  for (const char* width : {"", "0", "8", "-16", "264", "272", "999", "0016", "16x", "100000000000000000000"})
    EXPECT_EQ(message([&](PlainWeights& w) { w.metadata["width"] = width; }),
              std::string("random, metadata width: expected a multiple of 16 up to 256, found ") + width);
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["width"] = "32"; }),
            "random, tensor encoder.in.weight: expected shape 32x24x3x3, found 16x24x3x3");
  EXPECT_EQ(message([](PlainWeights& w) { w.tensors.erase("denoise.merge0.bias"); }),
            "random: tensor denoise.merge0.bias is missing");
  EXPECT_EQ(message([](PlainWeights& w) {
              w.tensors["denoise.in.colour.bias"] = {{16}, std::vector<float>(16)};
            }),
            "random, tensor denoise.in.colour.bias: no layer takes it");
}

}  // namespace
}  // namespace fathom::nn
