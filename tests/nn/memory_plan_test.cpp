// Where the values of graphs lie: never on one another, and as low as can be.
#include "nn/memory_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "nn/compositional_layers.h"
#include "tests/reference/compositional.h"

namespace fathom::nn {
namespace {

using reference::PlainWeights;
using reference::randomVolume;

// Convolutions of 16 channels.
PlainWeights convolutions(std::initializer_list<const char*> names) {
  PlainWeights weights;
  for (const std::string name : names) {
    weights.tensors[name + ".weight"] = {{16, 16, 3, 3}, floatsOf(randomVolume(16 * 16, 3, 3, 1, -1, 1))};
    weights.tensors[name + ".bias"] = {{16}, floatsOf(randomVolume(1, 1, 16, 2, -1, 1))};
  }
  return weights;
}

// No two rooms that are taken at the same time overlap, no value leaves its room, and rooms are shared.
void checkMemory(const Graph& graph, int height, int width) {
  const ElementSizes sizes = {16, 4};
  const MemoryPlan plan = planMemory(graph, height, width, sizes, {});
  size_t rooms = 0, values = 0;
  for (size_t i = 0; i < plan.rooms.size(); ++i) {
    const Room& a = plan.rooms[i];
    rooms += a.bytes;
    EXPECT_EQ(a.offset % 64, 0U);
    EXPECT_LE(a.offset + a.bytes, plan.bytes);
    for (size_t k = 0; k < i; ++k) {
      const Room& b = plan.rooms[k];
      const bool together = a.first <= b.last && b.first <= a.last;
      const bool apart = a.offset + a.bytes <= b.offset || b.offset + b.bytes <= a.offset;
      EXPECT_TRUE(!together || apart) << "rooms " << k << " and " << i;
    }
  }
  for (size_t v = 0; v < graph.values().size(); ++v) {
    const Graph::Info& info = graph.values()[v];
    const MemoryPlan::Place& place = plan.places[v];
    EXPECT_EQ(place.room < 0, info.input);
    if (info.input) continue;
    values += bytesOf(info, sizes, height, width);
    EXPECT_LE(place.offset + bytesOf(info, sizes, height, width), plan.rooms[size_t(place.room)].bytes);
  }
  EXPECT_LT(plan.bytes, rooms);
  EXPECT_LT(rooms, values);
  EXPECT_LT(plan.bytes, values / 2);
}

TEST(MemoryPlan, SharesRoomAndNeverOverlaps) {
  const WeightFile file = readWeights(reference::safetensors(reference::randomCompositional(16, 1)), "x");
  WeightSource source(file);
  checkMemory(decomposeGraph(source, 16).graph, 32, 48);
  checkMemory(denoiseGraph(source, 16).graph, 32, 48);
}

// What is live at a layer, by the definition: written before or there, and read there or later.
TEST(MemoryPlan, LiveValuesNeverLieOnOneAnother) {
  const WeightFile file = readWeights(reference::safetensors(reference::randomCompositional(16, 1)), "x");
  WeightSource source(file);
  const Graph graph = decomposeGraph(source, 16).graph;
  const ElementSizes sizes = {16, 4};
  const MemoryPlan plan = planMemory(graph, 16, 16, sizes, {});
  const auto& layers = graph.layers();
  const auto livesAfter = [&](Value value, size_t i) {
    if (graph.info(value).output) return true;
    for (size_t k = i + 1; k < layers.size(); ++k) {
      for (const Value& from : layers[k].from)
        if (from.index == value.index) return true;
      if (layers[k].conv.add.index == value.index) return true;
    }
    return false;
  };
  for (size_t i = 0; i < layers.size(); ++i) {
    if (layers[i].kind == Graph::Kind::concat) continue;  // its parts lie in it
    const size_t begin = plan.offsetOf(layers[i].to), end = begin + bytesOf(graph.info(layers[i].to), sizes, 16, 16);
    for (size_t k = 0; k < i; ++k) {
      const Value other = layers[k].to;
      const bool read = std::ranges::find(layers[i].from, other.index, &Value::index) != layers[i].from.end();
      if (!read && !livesAfter(other, i)) continue;
      const size_t from = plan.offsetOf(other), to = from + bytesOf(graph.info(other), sizes, 16, 16);
      EXPECT_TRUE(to <= begin || end <= from) << layers[i].name << " writes on " << layers[k].name;
    }
  }
}

// A term that is made early and added late lives until then, and nothing is added in place that is of another size.
TEST(MemoryPlan, TermsLiveUntilTheyAreAdded) {
  const PlainWeights weights = convolutions({"term", "a", "b", "sum"});
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  for (const bool floats : {false, true}) {
    WeightSource source(file);
    Graph graph;
    const Value in = graph.input(16), term = graph.conv(source, "term", in, {.channels = 16});
    const Value a = graph.conv(source, "a", in, {.channels = 16}), b = graph.conv(source, "b", a, {.channels = 16});
    const Value sum = graph.conv(source, "sum", b, {.channels = 16, .add = term});
    graph.output(sum, floats);
    const MemoryPlan plan = planMemory(graph, 16, 16, {16, 2}, {});
    const Room& room = plan.rooms[size_t(plan.places[size_t(term.index)].room)];
    EXPECT_TRUE(room.first <= 0 && room.last >= 3);
    EXPECT_EQ(plan.addsInPlace[3], !floats);
  }
}

// What a value is added to lies where it lay, but not where that is still read or to be kept.
TEST(MemoryPlan, AddsInPlaceWhatNobodyNeedsAnyMore) {
  const WeightFile file = readWeights(reference::safetensors(convolutions({"a", "b", "c"})), "x");
  struct Case {
    bool adds, reads, keeps, later;
    bool inPlace;
  };
  for (const Case& c : {Case{true, false, false, false, true},
                        {true, true, false, false, false},
                        {true, false, true, false, false},
                        {true, false, false, true, false}}) {
    WeightSource source(file);
    Graph graph;
    const Value in = graph.input(16), a = graph.conv(source, "a", in, {.channels = 16});
    const Value b = graph.conv(source, "b", c.reads ? a : in, {.channels = 16, .add = a});
    if (c.keeps) graph.output(a);
    graph.output(graph.conv(source, "c", c.later ? a : b, {.channels = 16}));
    graph.output(b);
    const MemoryPlan plan = planMemory(graph, 16, 16, {16, 4}, {});
    EXPECT_EQ(plan.addsInPlace[1], c.inPlace) << c.reads << c.keeps << c.later;
    EXPECT_EQ(plan.offsetOf(a) == plan.offsetOf(b), c.inPlace) << c.reads << c.keeps << c.later;
  }
}

// The first layer that writes and the last that reads each value, by the definition.
std::vector<std::pair<int, int>> livesOf(const Graph& graph) {
  std::vector<std::pair<int, int>> lives(graph.values().size());
  const int layers = int(graph.layers().size());
  for (size_t v = 0; v < lives.size(); ++v) {
    int first = layers, last = -1;
    for (int i = 0; i < layers; ++i) {
      const Graph::Layer& layer = graph.layers()[size_t(i)];
      const bool reads = std::ranges::find(layer.from, int(v), &Value::index) != layer.from.end();
      if (layer.to.index == int(v)) first = std::min(first, i), last = std::max(last, i);
      if (reads || layer.conv.add.index == int(v)) last = std::max(last, i);
    }
    lives[v] = {first, graph.values()[v].output ? layers : last};
  }
  return lives;
}

// By trying: the lowest end of another room, or 0, where nothing is in the way.
size_t lowestPlace(const std::vector<Room>& placed, const Room& room) {
  std::vector<size_t> tries = {0};
  for (const Room& other : placed) tries.push_back(other.offset + other.bytes);
  std::ranges::sort(tries);
  for (const size_t offset : tries)
    if (std::ranges::none_of(placed, [&](const Room& other) {
          const bool together = other.first <= room.last && room.first <= other.last;
          return together && offset < other.offset + other.bytes && other.offset < offset + room.bytes;
        }))
      return offset;
  return 0;
}

// Rooms from the largest to the smallest, each as low as it can lie beside those before; as long as what is in them.
void expectLowest(const Graph& graph, const std::vector<size_t>& scratch) {
  const MemoryPlan plan = planMemory(graph, 32, 48, {16, 4}, scratch);
  const auto lives = livesOf(graph);
  std::vector<Room> rooms(plan.rooms.size(), Room{0, 0, 1 << 20, -1});
  for (size_t v = 0; v < lives.size(); ++v) {
    if (plan.places[v].room < 0) continue;
    Room& room = rooms[size_t(plan.places[v].room)];
    room.first = std::min(room.first, lives[v].first);
    room.last = std::max(room.last, lives[v].second);
    room.bytes = std::max(room.bytes, plan.places[v].offset + bytesOf(graph.values()[v], {16, 4}, 32, 48));
  }
  for (size_t i = 0; i < graph.layers().size(); ++i) {
    ASSERT_EQ(plan.scratch[i] >= 0, scratch[i] > 0) << i;
    if (scratch[i] > 0) rooms[size_t(plan.scratch[i])] = {0, (scratch[i] + 63) / 64 * 64, int(i), int(i)};
  }
  std::vector<size_t> order(rooms.size());
  std::iota(order.begin(), order.end(), size_t(0));
  std::ranges::stable_sort(order, std::greater(), [&](size_t i) { return rooms[i].bytes; });
  std::vector<Room> placed;
  size_t bytes = 0;
  for (const size_t i : order) {
    EXPECT_EQ(plan.rooms[i].bytes, rooms[i].bytes) << i;
    EXPECT_EQ(plan.rooms[i].first, rooms[i].first) << i;
    EXPECT_EQ(plan.rooms[i].last, rooms[i].last) << i;
    rooms[i].offset = lowestPlace(placed, rooms[i]);
    EXPECT_EQ(plan.rooms[i].offset, rooms[i].offset) << i;
    placed.push_back(rooms[i]);
    bytes = std::max(bytes, rooms[i].offset + rooms[i].bytes);
  }
  EXPECT_EQ(plan.bytes, bytes);
}

TEST(MemoryPlan, RoomsLieAsLowAsTheyCan) {
  const WeightFile file = readWeights(reference::safetensors(reference::randomCompositional(16, 1)), "x");
  std::mt19937 random(4);
  for (int j = 0; j < 12; ++j) {
    WeightSource source(file);
    const Graph graph = j % 2 ? decomposeGraph(source, 16).graph : denoiseGraph(source, 16).graph;
    std::vector<size_t> scratch(graph.layers().size());
    for (size_t& bytes : scratch)
      bytes = j < 2 ? 0 : random() % 3 == 0 ? 0 : random() % 4 == 0 ? 98304 : random() % 200000 + 1;
    expectLowest(graph, scratch);
  }
}

}  // namespace
}  // namespace fathom::nn
