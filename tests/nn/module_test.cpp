// Layers against their twins, and the memory that they share.
#include "nn/module.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <cmath>
#include <thread>

#include "nn/compositional_layers.h"
#include "tests/reference/compositional.h"

namespace fathom::nn {
namespace {

using reference::addConv;
using reference::PlainWeights;
using reference::randomVolume;
using reference::Volume;

std::vector<float> packed(const Volume& volume, Layout layout) {
  std::vector<float> values = floatsOf(volume);
  if (layout == Layout::planar) return values;
  const int block = machineBlock(), groups = (volume.channels + block - 1) / block;
  std::vector<float> result(size_t(groups * block * volume.height * volume.width));
  packPlanes(denseRows<const float>(values.data(), volume.channels, volume.height, volume.width), volume.height,
             volume.width, block, Element::float32, reinterpret_cast<std::byte*>(result.data()));
  return result;
}

// Runs a graph in a fresh arena full of NaN, and gives one of its outputs.
Volume run(const Module& module, const std::vector<Volume>& inputs, Value wanted) {
  const Graph& graph = module.graph();
  const auto plan = module.plan(inputs[0].height, inputs[0].width);
  std::vector<std::vector<float>> values;
  std::vector<const std::byte*> pointers;
  for (size_t i = 0; i < inputs.size(); ++i) values.push_back(packed(inputs[i], graph.info(graph.inputs()[i]).layout));
  for (const auto& v : values) pointers.push_back(reinterpret_cast<const std::byte*>(v.data()));
  Buffer<std::byte> arena(plan->layout().bytes, std::byte(0xff));
  plan->run(pointers, arena.data());
  const Graph::Info& info = graph.info(wanted);
  const int block = machineBlock();
  Volume out(info.channels, plan->height() / info.scale, plan->width() / info.scale);
  const auto* result = reinterpret_cast<const float*>(Plan::result(*plan, arena.data(), wanted));
  for (int c = 0; c < out.channels; ++c)
    for (int i = 0; i < out.height * out.width; ++i)
      out.values[size_t(c * out.height * out.width + i)] =
          double(result[size_t((c / block * out.height * out.width + i) * block + c % block)]);
  return out;
}

void expectNear(const Volume& found, const Volume& expected) {
  ASSERT_EQ(found.values.size(), expected.values.size());
  double most = 0;
  for (const double v : expected.values) most = std::max(most, std::fabs(v));
  for (size_t i = 0; i < found.values.size(); ++i) ASSERT_NEAR(found.values[i], expected.values[i], 3e-6 * most) << i;
}

struct ConvCase {
  int from, to, kernel;
  Activation activation;
};

TEST(Module, ConvolutionsEqualTheirTwin) {
  for (const ConvCase& c : {ConvCase{16, 16, 3, Activation::relu},
                            {24, 32, 3, Activation::none},
                            {3, 16, 3, Activation::relu},
                            {32, 26, 1, Activation::none},
                            {16, 3, 1, Activation::sigmoid},
                            {16, 32, 2, Activation::relu},
                            {48, 16, 1, Activation::relu},
                            {5, 7, 3, Activation::none}})
    for (const auto& [height, width] : {std::pair(2, 2), std::pair(6, 10), std::pair(4, 34)})
      for (const Layout layout : {Layout::blocked, Layout::planar}) {
        SCOPED_TRACE(
            fmt::format("{} to {}, {} wide, {}x{}, layout {}", c.from, c.to, c.kernel, height, width, int(layout)));
        PlainWeights weights;
        addConv(weights, "c", c.from, c.to, c.kernel, 3);
        const WeightFile file = readWeights(reference::safetensors(weights), "x");
        WeightSource source(file);
        Graph graph;
        const int stride = c.kernel == 2 ? 2 : 1;
        const Value in = graph.input(c.from, layout);
        const Value out = graph.conv(
            source, "c", in, {.channels = c.to, .kernel = c.kernel, .stride = stride, .activation = c.activation});
        graph.output(out);
        const Volume input = randomVolume(c.from, height, width, 5, -2, 2);
        Volume expected = reference::convolve(weights, "c", input, stride);
        if (c.activation == Activation::relu) expected = reference::relu(expected);
        if (c.activation == Activation::sigmoid) expected = reference::sigmoid(expected);
        const Module module(std::move(graph));
        expectNear(run(module, {input}, out), expected);
      }
}

TEST(Module, SumsConcatenationsAndEnlargementsEqualTheirTwins) {
  PlainWeights weights;
  addConv(weights, "down", 16, 32, 2, 1);
  addConv(weights, "shrink", 32, 16, 1, 2);
  addConv(weights, "keep", 16, 16, 3, 3);
  addConv(weights, "merge", 48, 16, 3, 4);
  addConv(weights, "first", 16, 16, 3, 5);
  addConv(weights, "second", 16, 16, 3, 6);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  const Conv same = {.channels = 16};
  const Value in = graph.input(16);
  const Value down = graph.conv(source, "down", in, {.channels = 32, .kernel = 2, .stride = 2});
  const Value shrunk =
      graph.conv(source, "shrink", down, {.channels = 16, .kernel = 1, .activation = Activation::none});
  // Adds an input, which must stay as it is; then a value that is used again.
  const Value kept = graph.conv(source, "keep", in, {.channels = 16, .add = in});
  const Value all = graph.concat({graph.upsample(shrunk), kept, graph.upsample(shrunk)});
  const Value merged = graph.conv(source, "merge", all, same);
  const Value first = graph.conv(source, "first", merged, {.channels = 16, .add = merged});
  const Value second = graph.conv(source, "second", first, {.channels = 16, .add = merged});
  graph.output(first);
  graph.output(second);
  source.finish();
  const Module module(std::move(graph));
  for (const auto& [height, width] : {std::pair(2, 2), std::pair(6, 14)}) {
    const Volume x = randomVolume(16, height, width, 9, -1, 1);
    const Volume up = reference::upsample(convolve(weights, "shrink", relu(convolve(weights, "down", x, 2))));
    const Volume keep = relu(plus(convolve(weights, "keep", x), x));
    const Volume m = relu(convolve(weights, "merge", reference::concat(reference::concat(up, keep), up)));
    const Volume a = relu(plus(convolve(weights, "first", m), m));
    const Volume b = relu(plus(convolve(weights, "second", a), m));
    expectNear(run(module, {x}, first), a);
    expectNear(run(module, {x}, second), b);
  }
}

// A value that is added twice stays until the second time.
TEST(Module, WhatIsAddedTwiceStaysAsItIs) {
  PlainWeights weights;
  for (const char* name : {"a", "b", "c", "d"}) addConv(weights, name, 16, 16, 3, uint32_t(*name));
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  const Value in = graph.input(16), a = graph.conv(source, "a", in, {.channels = 16});
  const Value b = graph.conv(source, "b", a, {.channels = 16});
  const Value once = graph.conv(source, "c", b, {.channels = 16, .add = a});
  const Value twice = graph.conv(source, "d", once, {.channels = 16, .add = a});
  graph.output(twice);
  const Module module(std::move(graph));
  const Volume x = randomVolume(16, 6, 10, 9, -1, 1);
  const Volume va = relu(convolve(weights, "a", x)), vb = relu(convolve(weights, "b", va));
  const Volume vc = relu(plus(convolve(weights, "c", vb), va));
  expectNear(run(module, {x}, twice), relu(plus(convolve(weights, "d", vc), va)));
}

TEST(Module, PlansAreSharedAndRunAtOnce) {
  PlainWeights weights;
  addConv(weights, "c", 16, 16, 3, 1);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  const Value in = graph.input(16), out = graph.conv(source, "c", in, {.channels = 16});
  graph.output(out);
  const Module module(std::move(graph));
  EXPECT_EQ(module.plan(32, 40), module.plan(32, 40));
  const Volume x = randomVolume(16, 32, 40, 1, -1, 1);
  const Volume expected = run(module, {x}, out);
  std::vector<Volume> found(4);
  {
    std::vector<std::jthread> threads;
    for (Volume& f : found) threads.emplace_back([&] { f = run(module, {x}, out); });
  }
  for (const Volume& f : found) EXPECT_EQ(f.values, expected.values);
}

// As many as a sequence of sizes may need; all go before there are more, but for those that somebody still has.
TEST(Module, KeepsSixtyFourPlans) {
  PlainWeights weights;
  addConv(weights, "c", 16, 16, 1, 1);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  graph.output(graph.conv(source, "c", graph.input(16), {.channels = 16, .kernel = 1}));
  const Module module(std::move(graph));
  std::vector<std::weak_ptr<const Plan>> plans;
  for (int i = 1; i <= 64; ++i) plans.push_back(module.plan(i, 2));
  for (const auto& plan : plans) EXPECT_FALSE(plan.expired());
  const std::shared_ptr<const Plan> used = module.plan(5, 2);
  EXPECT_EQ(used, plans[4].lock());
  const auto last = module.plan(65, 2);
  for (size_t i = 0; i < 64; ++i) EXPECT_EQ(plans[i].expired(), i != 4) << i;
  EXPECT_EQ(module.plan(65, 2), last);
}

TEST(Module, PlansAreForWholeMultiplesOfTheAlignment) {
  PlainWeights weights;
  addConv(weights, "down", 16, 16, 2, 1);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  graph.output(graph.conv(source, "down", graph.input(16), {.channels = 16, .kernel = 2, .stride = 2}));
  const Module module(std::move(graph));
  for (const auto& [height, width] :
       {std::pair(3, 4), std::pair(4, 3), std::pair(0, 4), std::pair(4, 0), std::pair(-2, 4), std::pair(4, -2)})
    EXPECT_THROW(module.plan(height, width), std::logic_error) << height << " x " << width;
  EXPECT_EQ(module.plan(4, 6)->width(), 6);
}

TEST(Module, LeavesTheThreadsOfItsCallerAsTheyWere) {
  PlainWeights weights;
  addConv(weights, "c", 16, 16, 3, 1);
  const WeightFile file = readWeights(reference::safetensors(weights), "x");
  WeightSource source(file);
  Graph graph;
  const Value in = graph.input(16), out = graph.conv(source, "c", in, {.channels = 16});
  graph.output(out);
  const Module module(std::move(graph));
  const int before = omp_get_max_threads();
  omp_set_num_threads(3);
  run(module, {randomVolume(16, 4, 4, 1, -1, 1)}, out);
  EXPECT_EQ(omp_get_max_threads(), 3);
  omp_set_num_threads(before);
}

TEST(Module, BfloatIsForThoseWhoAskForItOrMachinesThatMultiplyIt) {
  EXPECT_EQ(elementFor(Precision::float32), Element::float32);
  EXPECT_EQ(elementFor(Precision::bfloat16), Element::bfloat16);
  EXPECT_EQ(elementFor(Precision::automatic), machineHasBfloat16() ? Element::bfloat16 : Element::float32);
}

}  // namespace
}  // namespace fathom::nn
