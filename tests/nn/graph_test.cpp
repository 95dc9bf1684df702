// What a graph reaches, counts and refuses.
#include "nn/graph.h"

#include <gtest/gtest.h>

#include "nn/module.h"
#include "tests/reference/layers.h"

namespace fathom::nn {
namespace {

using reference::addConv;
using reference::PlainWeights;

TEST(Graph, ReachesAsFarAsItsLayers) {
  PlainWeights weights;
  addConv(weights, "a", 16, 16, 3, 1);
  addConv(weights, "down", 16, 16, 2, 1);
  addConv(weights, "b", 16, 16, 3, 1);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  const Value in = graph.input(16), unused = graph.input(16);
  const Value a = graph.conv(source, "a", in, {.channels = 16});
  const Value down = graph.conv(source, "down", a, {.channels = 16, .kernel = 2, .stride = 2});
  const Value up = graph.upsample(graph.conv(source, "b", down, {.channels = 16}));
  EXPECT_EQ(graph.alignment(), 2);
  EXPECT_EQ(graph.reach({{a.index, {0, 4}}})[0], (Interval{-1, 5}));
  EXPECT_EQ(graph.reach({{down.index, {0, 2}}})[0], (Interval{-1, 5}));
  EXPECT_EQ(graph.reach({{up.index, {0, 4}}})[0], (Interval{-3, 7}));
  EXPECT_EQ(graph.reach({{up.index, {-1, 3}}})[0], (Interval{-5, 7}));
  EXPECT_EQ(graph.reach({{up.index, {0, 4}}})[size_t(unused.index)], (Interval{0, 0}));
  EXPECT_DOUBLE_EQ(graph.flopPerPixel(), 2.0 * 16 * 16 * (9 + 4 / 4.0 + 9 / 4.0));
}

TEST(Graph, RefusesWhatItCannotRun) {
  PlainWeights weights;
  addConv(weights, "c", 16, 16, 3, 1);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  const Value in = graph.input(16), other = graph.input(8);
  EXPECT_THROW(graph.conv(source, "c", in, {.channels = 16, .kernel = 4}), std::logic_error);
  EXPECT_THROW(graph.conv(source, "c", in, {.channels = 16, .kernel = 3, .stride = 2}), std::logic_error);
  EXPECT_THROW(graph.conv(source, "c", in, {.channels = 16, .add = other}), std::logic_error);
  EXPECT_THROW(graph.upsample(in), std::logic_error);
  EXPECT_THROW(graph.concat({in, other}), std::logic_error);
  EXPECT_THROW(graph.output(in), std::logic_error);
  const Value c = graph.conv(source, "c", in, {.channels = 16});
  graph.concat({c});
  EXPECT_THROW(graph.concat({c}), std::logic_error);
  const Module module(std::move(graph));
  EXPECT_THROW(module.plan(0, 4), std::logic_error);
}

TEST(Graph, ReachesThroughWhatIsAdded) {
  PlainWeights weights;
  for (const char* name : {"a", "b"}) addConv(weights, name, 16, 16, 3, 1);
  addConv(weights, "c", 16, 16, 1, 1);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  const Value in = graph.input(16);
  const Value b = graph.conv(source, "b", graph.conv(source, "a", in, {.channels = 16}), {.channels = 16});
  const Value c = graph.conv(source, "c", in, {.channels = 16, .kernel = 1, .add = b});
  EXPECT_EQ(graph.reach({{c.index, {0, 4}}})[0], (Interval{-2, 6}));
}

TEST(Graph, RefusesPartsThatDoNotFit) {
  PlainWeights weights;
  addConv(weights, "c", 16, 16, 3, 1);
  addConv(weights, "odd", 16, 24, 3, 1);
  addConv(weights, "down", 16, 16, 2, 1);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  const Value in = graph.input(16), c = graph.conv(source, "c", in, {.channels = 16});
  const Value odd = graph.conv(source, "odd", in, {.channels = 24}),
              last = graph.conv(source, "c", in, {.channels = 16});
  const Value down = graph.conv(source, "down", in, {.channels = 16, .kernel = 2, .stride = 2});
  EXPECT_THROW(graph.concat({odd, c}), std::logic_error);
  EXPECT_THROW(graph.concat({c, in}), std::logic_error);
  EXPECT_THROW(graph.concat({c, down}), std::logic_error);
  EXPECT_THROW(graph.conv(source, "c", in, {.channels = 16, .add = down}), std::logic_error);
  EXPECT_THROW(graph.conv(source, "down", in, {.channels = 16, .kernel = 2, .stride = 2, .add = c}), std::logic_error);
  graph.output(last);
  EXPECT_THROW(graph.concat({c, last}), std::logic_error);
  EXPECT_EQ(graph.info(graph.concat({c, odd})).channels, 40);
}

}  // namespace
}  // namespace fathom::nn
