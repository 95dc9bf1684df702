#include "nn/unet.h"

namespace fathom::nn {

namespace {

// What is enlarged comes before what kept its size.
Value merge(Graph& graph, WeightSource& weights, const std::string& name, const std::string& level, Value coarse,
            Value fine, int channels) {
  const Conv shrink = {.channels = channels, .kernel = 1, .activation = Activation::none};
  const Value enlarged = graph.upsample(graph.conv(weights, name + ".up" + level, coarse, shrink));
  return graph.conv(weights, name + ".merge" + level, graph.concat({enlarged, fine}), {.channels = channels});
}

}  // namespace

Value residualBlock(Graph& graph, WeightSource& weights, const std::string& name, Value from, int channels) {
  const Value middle = graph.conv(weights, name + ".0", from, {.channels = channels});
  return graph.conv(weights, name + ".1", middle, {.channels = channels, .add = from});
}

UNetLevels unetLevels(Graph& graph, WeightSource& weights, const std::string& name, Value in, int w) {
  const Value x0 = residualBlock(graph, weights, name + ".level0", in, w);
  const Value down0 = graph.conv(weights, name + ".down0", x0, {.channels = 2 * w, .kernel = 2, .stride = 2});
  const Value x1 = residualBlock(graph, weights, name + ".level1", down0, 2 * w);
  const Value down1 = graph.conv(weights, name + ".down1", x1, {.channels = 4 * w, .kernel = 2, .stride = 2});
  const Value x2 = residualBlock(graph, weights, name + ".level2", down1, 4 * w);
  const Value y1 = merge(graph, weights, name, "1", x2, x1, 2 * w);
  const Value y0 = merge(graph, weights, name, "0", y1, x0, w);
  return {y0, y1, x2};
}

}  // namespace fathom::nn
