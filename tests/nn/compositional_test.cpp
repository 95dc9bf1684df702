// The whole network against its double-precision twin, tiles against the whole, and threads against one.
#include "nn/compositional.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <ctime>
#include <filesystem>

#include "base/error.h"
#include "nn/tiles.h"
#include "tests/reference/compositional.h"

namespace fathom::nn {
namespace {

using reference::CompositionalTwin;
using reference::PlainWeights;
using reference::randomCompositional;
using reference::randomVolume;
using reference::Volume;

WeightFile fileOf(const PlainWeights& weights) {
  return readWeights(reference::safetensors(weights), "random");
}

// Random planes and colours, and what of them a network takes.
struct Frame {
  Volume planes, colour;
  std::vector<float> planeValues, colourValues;

  Frame(int height, int width, uint32_t seed)
      : planes(randomVolume(kInputPlanes, height, width, seed, -1, 1)),
        colour(randomVolume(3, height, width, seed + 1, 0, 3)),
        planeValues(floatsOf(planes)),
        colourValues(floatsOf(colour)) {}

  CompositionalInput input() const {
    return {denseRows(planeValues.data(), kInputPlanes, colour.height, colour.width),
            denseRows(colourValues.data(), 3, colour.height, colour.width), colour.height, colour.width};
  }
  size_t values() const { return colourValues.size(); }
};

std::vector<float> whole(const CompositionalNet& net, const Frame& frame, int components) {
  std::vector<float> result(frame.values(), -1.0f);
  CompositionalNet::Workspace workspace;
  const CompositionalInput input = frame.input();
  net.denoise(input, {0, 0, input.width, input.height}, components,
              denseRows(result.data(), 3, input.height, input.width), workspace);
  return result;
}

std::vector<float> tiled(const CompositionalNet& net, const Frame& frame, const TileParams& params,
                         const std::function<BlockWorth(const Window&)>& worth = {}, const Progress& progress = {}) {
  std::vector<float> result(frame.values(), -1.0f);
  const CompositionalInput input = frame.input();
  const std::vector<Tile> tiles = planTiles(net, input.height, input.width, params, worth);
  denoiseTiles(net, input, tiles, denseRows(result.data(), 3, input.height, input.width), params.memory, progress);
  return result;
}

// In the smallest tiles.
TileParams small(int components) {
  return {.memory = 1, .least = components, .most = components};
}

template <class T>
double largest(const std::vector<T>& values) {
  double most = 0;
  for (const T v : values) most = std::max(most, std::fabs(double(v)));
  return most;
}

template <class A, class B>
double largestDifference(const std::vector<A>& a, const std::vector<B>& b) {
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i) most = std::max(most, std::fabs(double(a[i]) - double(b[i])));
  return most;
}

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

// Weights with which every 3x3 convolution moves what it sees by a pixel and hands it on undiminished, so that what is as
// far away as can be counts as much as what is near.
PlainWeights passing(bool left) {
  PlainWeights weights = randomCompositional(16, 2);
  for (auto& [name, tensor] : weights.tensors) {
    if (!name.ends_with(".weight") || tensor.shape[2] == 1) continue;
    const int side = int(tensor.shape[3]);
    for (size_t i = 0; i < tensor.values.size(); ++i) {
      const int x = int(i) % side, y = int(i) / side % side;
      const bool kept = side == 2 || (y == 1 && x == (left ? 2 : 0));
      tensor.values[i] = kept ? 1.0f / float(tensor.shape[1]) : 0.0f;
    }
  }
  return weights;
}

// The pixels whose colour changes with one pixel of the planes.
std::vector<bool> moved(const CompositionalNet& net, int height, int width, int components, int at) {
  Frame frame(height, width, 3);
  std::ranges::fill(frame.planeValues, 0.0f);
  const std::vector<float> before = whole(net, frame, components);
  for (int p = 0; p < kInputPlanes; ++p) frame.planeValues[size_t((p * height + height / 2) * width + at)] = 500;
  const std::vector<float> after = whole(net, frame, components);
  std::vector<bool> result(static_cast<size_t>(width));
  for (size_t i = 0; i < after.size(); ++i)
    if (before[i] != after[i]) result[i % size_t(width)] = true;
  return result;
}

// No pixel beyond the halo decides, and one less than kAlignment within it does: a smaller halo would be wrong, a larger one
// waste.
TEST(CompositionalNet, HaloIsWhatTheOutputDependsOn) {
  constexpr int kHeight = 8, kWidth = 320, kAt = 160, kTile = CompositionalNet::kAlignment;
  for (const int components : {1, 2, 4}) {
    int reached = 0, halo = 0;
    for (const bool left : {false, true}) {
      const CompositionalNet net(fileOf(passing(left)));
      halo = net.halo(components);
      for (int at = kAt; at < kAt + kTile; ++at) {
        const std::vector<bool> changed = moved(net, kHeight, kWidth, components, at);
        for (int x = 0; x < kWidth; ++x) {
          const int tile = x - x % kTile;  // how far away from its tile the pixel lies
          if (changed[size_t(x)]) reached = std::max({reached, tile - at, at - (tile + kTile - 1)});
        }
      }
    }
    EXPECT_LE(reached, halo) << "K = " << components;
    EXPECT_GT(reached, halo - kTile) << "K = " << components;
    EXPECT_EQ(halo % kTile, 0);
  }
}

// Tiles of a frame whose far pixels count: with a halo that is too small by one step they are not those of the whole frame.
TEST(Tiles, HaveAllThatDecidesThem) {
  for (const bool left : {false, true}) {
    const CompositionalNet net(fileOf(passing(left)));
    Frame frame(64, 320, 3);
    for (float& v : frame.planeValues) v = v > 0.9f ? 500.0f : 0.0f;
    for (const int components : {1, 2, 4}) {
      const std::vector<float> expected = whole(net, frame, components);
      EXPECT_LT(largestDifference(tiled(net, frame, small(components)), expected), 1e-5 * largest(expected))
          << "K = " << components;
    }
  }
}

int threadsOfProcess() {
  return int(std::distance(std::filesystem::directory_iterator("/proc/self/task"), {}));
}

double cpuSeconds(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
}

// A tile is one thread's work, whatever OpenMP may take: tiles are what runs beside one another.
TEST(CompositionalNet, WorksInTheThreadThatCallsIt) {
  const CompositionalNet net(fileOf(randomCompositional(16, 1)));
  const Frame frame(192, 192, 7);
  whole(net, frame, 2);
  const int threads = threadsOfProcess();
  const double process = cpuSeconds(CLOCK_PROCESS_CPUTIME_ID), own = cpuSeconds(CLOCK_THREAD_CPUTIME_ID);
  for (int i = 0; i < 3; ++i) whole(net, frame, 2);
  const double ownTime = cpuSeconds(CLOCK_THREAD_CPUTIME_ID) - own;
  EXPECT_LT(cpuSeconds(CLOCK_PROCESS_CPUTIME_ID) - process, 1.1 * ownTime + 0.005);
  EXPECT_EQ(threadsOfProcess(), threads);
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
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["version"] = "2"; }),
            "random, metadata version: expected 1, found 2");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["inputs"] = "23"; }),
            "random, metadata inputs: expected 24, found 23");
  for (const char* width : {"", "0", "8", "-16", "999", "16x", "100000000000000000000"})
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
