#include "nn/layers_graphs.h"

#include "nn/kernel_filter.h"
#include "nn/unet.h"

namespace fathom::nn {

namespace {

constexpr int kPartition = 16;  // channels of the partition's second layer
constexpr Conv kDense = {.channels = kEmbedding, .kernel = 1};
constexpr Conv kContext = {.channels = kEmbedding, .kernel = 1, .activation = Activation::none};

Value reducer(Graph& graph, WeightSource& weights, Value inputs) {
  Value value = inputs;
  for (const char* name : {"reducer.0", "reducer.1", "reducer.2"}) value = graph.conv(weights, name, value, kDense);
  return value;
}

std::string kernelName(int scale) {
  return "kernel" + std::to_string(scale);
}

}  // namespace

EmbedGraph embedGraph(WeightSource& weights) {
  EmbedGraph result;
  result.inputs = result.graph.input(kSampleInputs);
  result.embedding = reducer(result.graph, weights, result.inputs);
  result.graph.output(result.embedding, true);
  return result;
}

PartitionGraph partitionGraph(WeightSource& weights) {
  PartitionGraph result;
  Graph& graph = result.graph;
  result.inputs = graph.input(kSampleInputs);
  result.context = graph.input(kEmbedding);
  result.embedding = reducer(graph, weights, result.inputs);
  Conv first = kDense;
  first.bias = false;
  first.add = result.context;
  const Value x = graph.conv(weights, "partition.embedding", result.embedding, first);
  const Value y = graph.conv(weights, "partition.1", x, {.channels = kPartition, .kernel = 1});
  const Conv last = {.channels = kMostLayers, .kernel = 1, .activation = Activation::none};
  result.logits = graph.conv(weights, "partition.2", y, last);
  graph.output(result.embedding);
  graph.output(result.logits, true);
  return result;
}

ContextGraph contextGraph(WeightSource& weights, int width) {
  ContextGraph result;
  Graph& graph = result.graph;
  result.mean = graph.input(kEmbedding);
  const Value in = graph.conv(weights, "unet.in", result.mean, {.channels = width});
  const UNetLevels levels = unetLevels(graph, weights, "unet", in, width);
  result.partition = graph.conv(weights, "partition.context", levels.y0, kContext);
  graph.output(result.partition);
  const Value from[kLayerScales] = {levels.y0, levels.y1, levels.x2};
  for (int i = 0; i < kLayerScales; ++i) {
    result.kernel[i] = graph.conv(weights, kernelName(i) + ".context", from[i], kContext);
    graph.output(result.kernel[i]);
  }
  return result;
}

KernelGraph kernelGraph(WeightSource& weights, int scale) {
  KernelGraph result;
  Graph& graph = result.graph;
  result.embedding = graph.input(kEmbedding);
  result.context = graph.input(kEmbedding);
  Conv first = kDense;
  first.bias = false;
  first.add = result.context;
  const Value x = graph.conv(weights, kernelName(scale) + ".embedding", result.embedding, first);
  const Value y = graph.conv(weights, kernelName(scale) + ".1", x, kDense);
  const int outputs = kKernelTaps + (scale == 0 ? kLayerScales : 0);
  const Conv last = {.channels = outputs, .kernel = 1, .activation = Activation::none};
  result.logits = graph.conv(weights, kernelName(scale) + ".2", y, last);
  graph.output(result.logits, true);
  return result;
}

}  // namespace fathom::nn
