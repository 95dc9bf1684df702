#include "nn/compositional_layers.h"

#include "nn/kernel_filter.h"

namespace fathom::nn {

namespace {

// Two convolutions, with what goes in added to what comes out.
Value block(Graph& graph, WeightSource& weights, const std::string& name, Value from, int channels) {
  const Value middle = graph.conv(weights, name + ".0", from, {.channels = channels});
  return graph.conv(weights, name + ".1", middle, {.channels = channels, .add = from});
}

// What is enlarged comes before what kept its size.
Value merge(Graph& graph, WeightSource& weights, const std::string& name, const std::string& level, Value coarse,
            Value fine, int channels) {
  const Conv shrink = {.channels = channels, .kernel = 1, .activation = Activation::none};
  const Value enlarged = graph.upsample(graph.conv(weights, name + ".up" + level, coarse, shrink));
  return graph.conv(weights, name + ".merge" + level, graph.concat({enlarged, fine}), {.channels = channels});
}

struct Levels {
  Value y0, y1, x2;
};

Levels unet(Graph& graph, WeightSource& weights, const std::string& name, Value colour, Value features, int w) {
  const Value f = graph.conv(weights, name + ".in.features", features, {.channels = w, .activation = Activation::none});
  const Value x = graph.conv(weights, name + ".in.colour", colour, {.channels = w, .bias = false, .add = f});
  const Value x0 = block(graph, weights, name + ".level0", x, w);
  const Value down0 = graph.conv(weights, name + ".down0", x0, {.channels = 2 * w, .kernel = 2, .stride = 2});
  const Value x1 = block(graph, weights, name + ".level1", down0, 2 * w);
  const Value down1 = graph.conv(weights, name + ".down1", x1, {.channels = 4 * w, .kernel = 2, .stride = 2});
  const Value x2 = block(graph, weights, name + ".level2", down1, 4 * w);
  const Value y1 = merge(graph, weights, name, "1", x2, x1, 2 * w);
  const Value y0 = merge(graph, weights, name, "0", y1, x0, w);
  return {y0, y1, x2};
}

}  // namespace

EncoderGraph encoderGraph(WeightSource& weights, int width) {
  EncoderGraph result;
  Graph& graph = result.graph;
  result.planes = graph.input(kInputPlanes);
  const Value in = graph.conv(weights, "encoder.in", result.planes, {.channels = width});
  result.features = block(graph, weights, "encoder.block", in, width);
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
  result.first = block(graph, weights, "decompose.first", y0, width);
  result.second = block(graph, weights, "decompose.second", y0, width);
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
  const Levels levels = unet(graph, weights, "denoise", result.colour, result.features, width);
  const Value from[3] = {levels.y0, levels.y1, levels.x2};
  for (int i = 0; i < 3; ++i) {
    const Conv conv = {.channels = kKernelTaps + (i < 2), .kernel = 1, .activation = Activation::none};
    result.kernel[i] = graph.conv(weights, "denoise.kernel" + std::to_string(i), from[i], conv);
    graph.output(result.kernel[i], true);
  }
  return result;
}

}  // namespace fathom::nn
