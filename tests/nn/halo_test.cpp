// How far the network looks, and that tiles have all of it; that a tile is the work of one thread.
#include <gtest/gtest.h>
#include <omp.h>

#include <ctime>
#include <filesystem>

#include "nn/tiles.h"
#include "tests/reference/compositional.h"
#include "tests/reference/random_planes.h"

namespace fathom::nn {
namespace {

using reference::fileOf;
using reference::Frame;
using reference::largest;
using reference::largestDifference;
using reference::PlainWeights;
using reference::randomCompositional;
using reference::small;
using reference::tiled;
using reference::whole;

// Weights with which every 3x3 convolution moves what it sees by a pixel and hands it on undiminished, so that what is as
// far away as can be counts as much as what is near.
PlainWeights passing(bool left) {
  PlainWeights weights = randomCompositional(16, 2);
  for (auto& [name, tensor] : weights.tensors) {
    const bool head = name.find(".kernel") != std::string::npos || name.find(".mask") != std::string::npos;
    if (head) continue;  // they stay random, so that what arrives is told apart
    const bool colour = name.find(".colour.") != std::string::npos;  // weak: nothing but the planes decides
    const int side = tensor.shape.size() == 4 ? int(tensor.shape[3]) : 0;
    for (size_t i = 0; i < tensor.values.size(); ++i) {
      const int x = side ? int(i) % side : 0, y = side ? int(i) / side % side : 0;
      const bool kept = side && (side < 3 || (y == 1 && x == (left ? 2 : 0)));
      const float weight = colour ? 1e-6f : side == 2 ? 0.25f : 1.0f;  // nothing grows until all looks alike
      tensor.values[i] = kept ? weight / float(tensor.shape[1]) : 0.0f;
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
    for (float& v : frame.planeValues) v = v > 0.98f ? 5.0f : 0.0f;
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
  omp_set_num_threads(4);  // what oneDNN would take
  const CompositionalNet net(fileOf(randomCompositional(16, 1)));
  const Frame frame(192, 192, 7);
  const int threads = threadsOfProcess();
  const double process = cpuSeconds(CLOCK_PROCESS_CPUTIME_ID), own = cpuSeconds(CLOCK_THREAD_CPUTIME_ID);
  for (int i = 0; i < 3; ++i) whole(net, frame, 2);
  const double ownTime = cpuSeconds(CLOCK_THREAD_CPUTIME_ID) - own;
  EXPECT_LT(cpuSeconds(CLOCK_PROCESS_CPUTIME_ID) - process, 1.1 * ownTime + 0.005);
  EXPECT_EQ(threadsOfProcess(), threads);
}

}  // namespace
}  // namespace fathom::nn
