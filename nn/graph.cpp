#include "nn/graph.h"

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "base/error.h"

namespace fathom::nn {

namespace {

constexpr int kMostBlock = 16;

// Mistakes in the program, not in a file.
void expect(bool fine, const std::string& name, const char* what) {
  if (!fine) throw std::logic_error("layer " + name + ": " + what);
}

int floorDiv(int a, int b) {
  return a >= 0 ? a / b : -((-a + b - 1) / b);
}
int ceilDiv(int a, int b) {
  return -floorDiv(-a, b);
}

// The pixels of a layer's inputs that `out` depends on.
Interval neededBy(const Graph::Layer& layer, const Interval& out) {
  if (layer.kind == Graph::Kind::concat) return out;
  if (layer.kind == Graph::Kind::upsample) return {floorDiv(out.begin, 2), ceilDiv(out.end, 2)};
  const int stride = layer.conv.stride, kernel = layer.conv.kernel, pad = kernel == 3 ? 1 : 0;
  return {out.begin * stride - pad, (out.end - 1) * stride - pad + kernel};
}

Buffer<float> copyOf(const Tensor& tensor) {
  return tensor.values.copy();
}

}  // namespace

Value Graph::add(const Info& info) {
  values_.push_back(info);
  return {int(values_.size()) - 1};
}

Value Graph::input(int channels, Layout layout) {
  const Value value = add({.channels = channels, .layout = layout, .input = true});
  inputs_.push_back(value);
  return value;
}

Value Graph::conv(WeightSource& weights, const std::string& name, Value from, const Conv& conv) {
  const Info in = info(from);
  const Info out = {.channels = conv.channels, .scale = in.scale * conv.stride};
  expect(conv.kernel >= 1 && conv.kernel <= 3, name, "kernels are 1, 2 or 3 wide");
  expect(conv.stride == 1 || conv.stride == 2, name, "strides are 1 or 2");
  expect((conv.kernel == 2) == (conv.stride == 2), name, "kernels of 2 go with strides of 2");
  if (conv.add.given()) {
    const Info& term = info(conv.add);
    expect(term.channels == out.channels && term.scale == out.scale && term.layout == Layout::blocked, name,
           "what is added has another shape");
  }
  Layer layer{Kind::conv, {from}, {}, conv, name, {}, {}};
  layer.weight = copyOf(weights.take(name + ".weight", {conv.channels, in.channels, conv.kernel, conv.kernel}));
  if (conv.bias) layer.bias = copyOf(weights.take(name + ".bias", {conv.channels}));
  const Value to = layer.to = add(out);
  layers_.push_back(std::move(layer));
  return to;
}

Value Graph::upsample(Value from) {
  Info out = info(from);
  expect(out.layout == Layout::blocked && out.scale % 2 == 0, "upsample", "what is enlarged was never made smaller");
  out = {.channels = out.channels, .scale = out.scale / 2};
  const Value to = add(out);
  layers_.push_back({Kind::upsample, {from}, to, {}, "upsample", {}, {}});
  return to;
}

Value Graph::concat(const std::vector<Value>& from) {
  Info out = {.scale = info(from.front()).scale};
  for (const Value& value : from) {
    const Info& in = info(value);
    expect(in.layout == Layout::blocked && in.scale == out.scale, "concat", "shapes differ");
    expect(!in.input && !in.output, "concat", "inputs and outputs have a place of their own");
    expect(out.channels % kMostBlock == 0, "concat", "a part begins inside a group of channels");
    for (const Layer& layer : layers_)
      expect(
          layer.kind != Kind::concat || std::ranges::find(layer.from, value.index, &Value::index) == layer.from.end(),
          "concat", "a value is part of two");
    out.channels += in.channels;
  }
  const Value to = add(out);
  layers_.push_back({Kind::concat, from, to, {}, "concat", {}, {}});
  return to;
}

void Graph::output(Value value, bool floats) {
  Info& out = values_[size_t(value.index)];
  expect(!out.input, "output", "an input is no output");
  out.output = true;
  out.floats = floats;
}

int Graph::alignment() const {
  int most = 1;
  for (const Info& value : values_) most = std::max(most, value.scale);
  return most;
}

double Graph::flopPerPixel() const {
  double sum = 0;
  for (const Layer& layer : layers_) {
    const double scale = info(layer.to).scale;
    if (layer.kind == Kind::conv) sum += 2 * double(layer.weight.size()) / (scale * scale);
  }
  return sum;
}

std::vector<Interval> Graph::reach(const std::map<int, Interval>& wanted) const {
  std::vector<std::optional<Interval>> needed(values_.size());
  const auto need = [&](Value value, const Interval& interval) {
    std::optional<Interval>& known = needed[size_t(value.index)];
    known = known ? known->with(interval) : interval;
  };
  for (const auto& [index, interval] : wanted) need({index}, interval);
  for (size_t i = layers_.size(); i-- > 0;) {
    const Layer& layer = layers_[i];
    const std::optional<Interval> out = needed[size_t(layer.to.index)];
    if (!out) continue;
    for (const Value& from : layer.from) need(from, neededBy(layer, *out));
    if (layer.conv.add.given()) need(layer.conv.add, *out);
  }
  std::vector<Interval> result;
  for (const Value& value : inputs_) result.push_back(needed[size_t(value.index)].value_or(Interval{}));
  return result;
}

}  // namespace fathom::nn
