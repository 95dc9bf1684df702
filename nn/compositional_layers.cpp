#include "nn/compositional_layers.h"

#include "nn/kernel_filter.h"
#include "nn/unet.h"

namespace fathom::nn {

namespace {

UNetLevels unet(Graph& graph, WeightSource& weights, const std::string& name, Value colour, Value features, int w) {
  const Value f = graph.conv(weights, name + ".in.features", features, {.channels = w, .activation = Activation::none});
  const Value x = graph.conv(weights, name + ".in.colour", colour, {.channels = w, .bias = false, .add = f});
  return unetLevels(graph, weights, name, x, w);
}

}  // namespace

EncoderGraph encoderGraph(WeightSource& weights, int width) {
  EncoderGraph result;
  Graph& graph = result.graph;
  result.planes = graph.input(kInputPlanes);
  const Value in = graph.conv(weights, "encoder.in", result.planes, {.channels = width});
  result.features = residualBlock(graph, weights, "encoder.block", in, width);
  graph.output(result.features);
  return result;
}

DecomposeGraph decomposeGraph(WeightSource& weights, int width) {
  DecomposeGraph result;
  Graph& graph = result.graph;
  result.colour = graph.input(3, Layout::planar);
  result.features = graph.input(width);
  const Value y0 = unet(graph, weights, "decompose", result.colour, result.features, width).y0;
  // nn/colour_kernel takes the sigmoid, with the colours at hand.
  result.mask = graph.conv(weights, "decompose.mask", y0, {.channels = 3, .kernel = 1, .activation = Activation::none});
  result.first = residualBlock(graph, weights, "decompose.first", y0, width);
  result.second = residualBlock(graph, weights, "decompose.second", y0, width);
  graph.output(result.mask, true);
  graph.output(result.first);
  graph.output(result.second);
  return result;
}

DenoiseGraph denoiseGraph(WeightSource& weights, int width) {
  DenoiseGraph result;
  Graph& graph = result.graph;
  result.colour = graph.input(3, Layout::planar);
  result.features = graph.input(width);
  const UNetLevels levels = unet(graph, weights, "denoise", result.colour, result.features, width);
  const Value from[3] = {levels.y0, levels.y1, levels.x2};
  for (int i = 0; i < 3; ++i) {
    const Conv conv = {.channels = kKernelTaps + (i < 2), .kernel = 1, .activation = Activation::none};
    result.kernel[i] = graph.conv(weights, "denoise.kernel" + std::to_string(i), from[i], conv);
    graph.output(result.kernel[i], true);
  }
  return result;
}

}  // namespace fathom::nn
