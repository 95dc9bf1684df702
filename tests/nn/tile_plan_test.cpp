// How frames are cut for the network: what is covered, what is skipped, and what components are taken for.
#include "nn/tile_plan.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "tests/reference/compositional.h"

namespace fathom::nn {
namespace {

const CompositionalNet& net() {
  static const CompositionalNet made(
      readWeights(reference::safetensors(reference::randomCompositional(16, 4)), "random"));
  return made;
}

double costOf(const std::vector<Tile>& tiles, int height, int width) {
  double sum = 0;
  for (const Tile& tile : tiles) sum += net().flop(tile.window, height, width, tile.components);
  return sum;
}

// How often each pixel is covered.
std::vector<int> covered(const std::vector<Tile>& tiles, int height, int width) {
  std::vector<int> result(size_t(height) * size_t(width));
  for (const Tile& tile : tiles)
    for (int y = tile.window.y; y < tile.window.y + tile.window.height; ++y)
      for (int x = tile.window.x; x < tile.window.x + tile.window.width; ++x)
        ++result[size_t(y) * size_t(width) + size_t(x)];
  return result;
}

TEST(TilePlan, CoversTheFrameOnce) {
  for (const size_t memory : {size_t(0), size_t(1), size_t(300) << 20})
    for (const auto& [height, width] :
         {std::pair(4, 4), std::pair(64, 68), std::pair(1080, 1920), std::pair(516, 2000)}) {
      const std::vector<Tile> tiles = planTiles(net(), height, width, {.memory = memory, .least = 4, .most = 4});
      for (const auto& [tile, components] : tiles) {
        ASSERT_TRUE(tile.x % 4 == 0 && tile.y % 4 == 0 && tile.width % 4 == 0 && tile.height % 4 == 0);
        ASSERT_EQ(components, 4);
      }
      EXPECT_EQ(std::ranges::count(covered(tiles, height, width), 1), ptrdiff_t(height) * width);
    }
}

TEST(TilePlan, KeepsWithinTheMemory) {
  for (const int components : {1, 2, 4})
    for (const size_t memory : {size_t(50) << 20, size_t(1) << 30})
      for (const Tile& tile :
           planTiles(net(), 1080, 1920, {.memory = memory, .least = components, .most = components})) {
        const bool smallest = std::max(tile.window.width, tile.window.height) <= 64;
        EXPECT_TRUE(smallest || bytesOfTile(net(), tile) <= double(memory)) << tile.window.width;
      }
}

// A frame whose work is in half of it costs half, wherever that half is.
TEST(TilePlan, HalfTheWorkIsHalfTheCost) {
  constexpr int kHeight = 1080, kWidth = 1920;
  for (const int components : {1, 4}) {
    const TileParams params = {.least = components, .most = components};
    const double all = costOf(planTiles(net(), kHeight, kWidth, params), kHeight, kWidth);
    const auto half = [&](const std::function<bool(const Window&)>& work) {
      const auto worth = [&](const Window& block) { return BlockWorth{.work = work(block)}; };
      return costOf(planTiles(net(), kHeight, kWidth, params, worth), kHeight, kWidth) / all;
    };
    EXPECT_LT(half([](const Window& b) { return b.x >= kWidth / 2; }), 0.58) << components;
    EXPECT_LT(half([](const Window& b) { return b.y >= kHeight / 2; }), 0.58) << components;
    // In the middle, of two thirds of the sides (0.44 of the area).
    EXPECT_LT(half([](const Window& b) {
                return b.x >= kWidth / 6 && b.x + b.width <= 5 * kWidth / 6 && b.y >= kHeight / 6 &&
                       b.y + b.height <= 5 * kHeight / 6;
              }),
              0.6)
        << components;
  }
}

TEST(TilePlan, BlocksWithWorkAreCoveredAndEmptyFramesAreNot) {
  const auto scattered = [](const Window& block) {
    return BlockWorth{.work = (block.x / 64 * 7 + block.y / 64) % 5 == 0};
  };
  const std::vector<int> times = covered(planTiles(net(), 600, 900, {}, scattered), 600, 900);
  EXPECT_LE(std::ranges::max(times), 1);
  for (int y = 0; y < 600; ++y)
    for (int x = 0; x < 900; ++x) {
      // Blocks begin anew in each of the two parts of a side, 480 and 320 pixels long.
      const Window block{x / 480 * 480 + x % 480 / 64 * 64, y / 320 * 320 + y % 320 / 64 * 64, 0, 0};
      ASSERT_TRUE(times[size_t(y) * 900 + size_t(x)] == 1 || !scattered(block).work) << x << " " << y;
    }
  EXPECT_TRUE(planTiles(net(), 600, 900, {}, [](const Window&) { return BlockWorth{.work = false}; }).empty());
}

// Tiles have no more than what needs them, wherever that ends in a block.
TEST(TilePlan, TilesEndWhereTheWorkEnds) {
  const Window part{100, 68, 372, 240};
  const auto within = [&](const Window& block) {
    const int x0 = std::max(block.x, part.x), y0 = std::max(block.y, part.y);
    const int x1 = std::min(block.x + block.width, part.x + part.width),
              y1 = std::min(block.y + block.height, part.y + part.height);
    if (x0 >= x1 || y0 >= y1) return BlockWorth{.work = false};
    return BlockWorth{.within = {x0, y0, x1 - x0, y1 - y0}};
  };
  EXPECT_EQ(planTiles(net(), 512, 512, {}, within), std::vector<Tile>({{part, 1}}));
  const std::vector<int> times = covered(planTiles(net(), 600, 900, {}, within), 600, 900);
  for (int y = 0; y < 600; ++y)
    for (int x = 0; x < 900; ++x)
      ASSERT_EQ(times[size_t(y) * 900 + size_t(x)], x >= 100 && x < 472 && y >= 68 && y < 308) << x << " " << y;
}

// Components are taken where the gain pays for the work, that of borders too.
TEST(TilePlan, ComponentsAreTakenForWhatTheyGain) {
  const auto componentsFor = [](double two, double four) {
    const std::vector<Tile> tiles =
        planTiles(net(), 480, 480, {.least = 1, .most = 4, .gainPerPass = 0.02}, [&](const Window&) {
          return BlockWorth{.gain = {two, four}};
        });
    return tiles.size() == 1 ? tiles.front().components : 0;
  };
  const double two = 0.02 * (net().flopPerPixel(2) / net().flopPerPixel(1) - 1),
               four = 0.02 * (net().flopPerPixel(4) / net().flopPerPixel(1) - 1);
  EXPECT_EQ(componentsFor(0, 0), 1);
  EXPECT_EQ(componentsFor(-1, -1), 1);
  EXPECT_EQ(componentsFor(0.9 * two, 0.9 * four), 1);
  EXPECT_EQ(componentsFor(1.1 * two, 1.02 * two), 2);
  EXPECT_EQ(componentsFor(0.3 * two, 1.1 * four), 4);
  // One block that gains is not worth its borders; many are.
  const auto some = [](double gain, int side) {
    const auto tiles = planTiles(net(), 480, 480, {.least = 1, .most = 4}, [&](const Window& block) {
      return BlockWorth{.gain = {0, block.x < side && block.y < side ? gain : 0}};
    });
    return std::ranges::any_of(tiles, [](const Tile& tile) { return tile.components == 4; });
  };
  EXPECT_FALSE(some(1.1 * four, 64));
  EXPECT_TRUE(some(2 * four, 320));
}

TEST(TilePlan, ComponentsDoNotDependOnMemoryOrThreads) {
  const auto worth = [](const Window& block) {
    return BlockWorth{.work = block.y < 700, .gain = {0.05, block.x < 700 ? 0.4 : 0.0}};
  };
  const auto componentsWith = [&](size_t memory) {
    std::vector<int> result(size_t(1080) * 1920);
    for (const auto& [tile, components] :
         planTiles(net(), 1080, 1920, {.memory = memory, .least = 1, .most = 4}, worth))
      for (int y = tile.y; y < tile.y + tile.height; ++y)
        std::fill_n(result.begin() + ptrdiff_t(y) * 1920 + tile.x, tile.width, components);
    return result;
  };
  const std::vector<int> expected = componentsWith(0);
  EXPECT_GT(std::ranges::count(expected, 4), 0);
  EXPECT_GT(std::ranges::count(expected, 1), 0);
  EXPECT_GT(std::ranges::count(expected, 0), 0);
  EXPECT_EQ(expected, componentsWith(1));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(expected, componentsWith(0));
}

int widest(size_t memory, int side) {
  int result = 0;
  for (const Tile& tile : planTiles(net(), side, side, {.memory = memory}))
    result = std::max(result, std::max(tile.window.width, tile.window.height));
  return result;
}

// Eight at once while they have 256 pixels a side, one at least while they have 64.
TEST(TilePlan, SidesGoByWhatFitsAtOnce) {
  const auto bytes = [](int side) { return bytesOfTile(net(), {{0, 0, side, side}, 1}); };
  EXPECT_EQ(widest(size_t(8.01 * bytes(512)), 512), 512);
  EXPECT_EQ(widest(size_t(7.99 * bytes(512)), 512), 256);
  EXPECT_EQ(widest(size_t(8.01 * bytes(288)), 288), 288);
  EXPECT_EQ(widest(size_t(7.99 * bytes(288)), 288), 160);  // halves of 144, in steps of 32
  EXPECT_EQ(widest(size_t(1.01 * bytes(256)), 256), 256);
  EXPECT_EQ(widest(size_t(0.99 * bytes(256)), 256), 128);
  EXPECT_EQ(widest(1, 64), 64);
}

// Random worths of 4 x 3 blocks, some of them without work, some with work in a part of them.
struct Worths {
  static constexpr int kAcross = 4, kDown = 3, kWide = kAcross * kBlock, kHigh = kDown * kBlock;
  std::vector<BlockWorth> of;
  TileParams params;

  explicit Worths(unsigned seed) : params{.least = 1, .most = 4} {
    std::mt19937 random(seed);
    const auto below = [&](int most) { return int(random() % unsigned(most)); };
    const int empty = below(10);
    const double worth = 0.4 * below(4);
    for (int i = 0; i < kAcross * kDown; ++i) {
      BlockWorth& block = of.emplace_back();
      block.work = below(10) >= empty;
      const int x = i % kAcross * kBlock, y = i / kAcross * kBlock, dx = 4 * below(8), dy = 4 * below(8);
      block.within = {x, y, kBlock, kBlock};
      if (below(3) == 0) block.within = {x + dx, y + dy, 4 * (1 + below(8)), 4 * (1 + below(8))};
      for (double& gain : block.gain) gain = worth * (below(1000) / 500.0 - 0.6);
    }
    params.least = seed % 5 == 1 ? 2 : 1;
    params.most = seed % 5 == 2 ? 2 : seed % 5 == 3 ? 1 : 4;
    params.least = std::min(params.least, params.most);
  }
  std::vector<Tile> planned() const {
    return planTiles(net(), kHigh, kWide, params,
                     [&](const Window& block) { return of[size_t(block.y / kBlock * kAcross + block.x / kBlock)]; });
  }
  // Of blocks [x0, x1) x [y0, y1) as one tile, in pixels of K = 1; nothing where there is no work.
  double costOf(int x0, int y0, int x1, int y1, int components, Window& window) const {
    int left = kWide, top = kHigh, right = 0, bottom = 0;
    double gain = 0;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) {
        const BlockWorth& block = of[size_t(y * kAcross + x)];
        if (!block.work) continue;
        const Window& w = block.within;
        left = std::min(left, w.x), top = std::min(top, w.y);
        right = std::max(right, w.x + w.width), bottom = std::max(bottom, w.y + w.height);
        const double each = components == 1 ? 0 : components == 2 ? block.gain[0] : block.gain[1];
        gain += each * w.width * w.height / params.gainPerPass;
      }
    window = {left, top, right - left, bottom - top};
    if (right == 0) return 0;
    return 2000 + net().flop(window, kHigh, kWide, components) / net().flopPerPixel(1) - gain;
  }
};

// By trying all ways to cut.
double leastCost(const Worths& worths, const std::array<int, 4>& at, std::map<std::array<int, 4>, double>& known) {
  if (const auto found = known.find(at); found != known.end()) return found->second;
  const auto [x0, y0, x1, y1] = at;
  double best = std::numeric_limits<double>::infinity();
  for (const int components : {1, 2, 4}) {
    Window window;
    if (components >= worths.params.least && components <= worths.params.most)
      best = std::min(best, worths.costOf(x0, y0, x1, y1, components, window));
  }
  for (int x = x0 + 1; x < x1; ++x)
    best = std::min(best, leastCost(worths, {x0, y0, x, y1}, known) + leastCost(worths, {x, y0, x1, y1}, known));
  for (int y = y0 + 1; y < y1; ++y)
    best = std::min(best, leastCost(worths, {x0, y0, x1, y}, known) + leastCost(worths, {x0, y, x1, y1}, known));
  return known[at] = best;
}

TEST(TilePlan, IsTheCheapestThereIs) {
  size_t cut = 0, one = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    const Worths worths(seed);
    const std::vector<Tile> tiles = worths.planned();
    double cost = 0;
    for (const Tile& tile : tiles) {
      const Window& w = tile.window;
      Window window;
      cost += worths.costOf(w.x / kBlock, w.y / kBlock, (w.x + w.width - 1) / kBlock + 1,
                            (w.y + w.height - 1) / kBlock + 1, tile.components, window);
      EXPECT_EQ(window.x, w.x);
      EXPECT_EQ(window.width, w.width);
      EXPECT_TRUE(tile.components >= worths.params.least && tile.components <= worths.params.most) << seed;
    }
    std::map<std::array<int, 4>, double> known;
    const double expected = leastCost(worths, {0, 0, Worths::kAcross, Worths::kDown}, known);
    EXPECT_NEAR(cost, expected, 1e-9 * std::fabs(expected)) << seed;
    cut += tiles.size() > 1;
    one += tiles.size() == 1;
  }
  EXPECT_GT(cut, 10u);
  EXPECT_GT(one, 10u);
}

}  // namespace
}  // namespace fathom::nn
