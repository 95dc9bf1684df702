// What a network computes: a list of layers with their weights, for one image at a time. Nothing here runs; see
// nn/module.h.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "base/buffer.h"
#include "nn/weights.h"

namespace fathom::nn {

enum class Activation { none, relu, sigmoid };

// Planar: [channels][height][width]. Blocked: [channels / block][height][width][block], the last group filled with zeros;
// the block is the machine's (nn/blocked.h).
enum class Layout { planar, blocked };

// What a layer gives, or an input; made by a Graph and known to that Graph only.
struct Value {
  int index = -1;
  bool given() const { return index >= 0; }
};

// Pixels [begin, end) of one axis.
struct Interval {
  int begin = 0, end = 0;

  Interval around(int pixels) const { return {begin - pixels, end + pixels}; }
  Interval with(const Interval& other) const {
    return {begin < other.begin ? begin : other.begin, end > other.end ? end : other.end};
  }
  bool operator==(const Interval&) const = default;
};

// A convolution's setting; the number of input channels and the weights' names are known otherwise.
struct Conv {
  int channels = 0;  // of the output
  int kernel = 3;    // 1 and 3: zero-padded to the size of the input; 2: unpadded, with stride 2
  int stride = 1;
  bool bias = true;
  Activation activation = Activation::relu;
  Value add = {};  // added before the activation: a value of the output's shape
};

class Graph {
 public:
  enum class Kind { conv, upsample, concat };

  struct Info {
    int channels = 0;
    int scale = 1;  // how many pixels of an input's row one of this is
    Layout layout = Layout::blocked;
    bool input = false, output = false;
    bool floats = false;  // float32 whatever the precision
  };

  struct Layer {
    Kind kind;
    std::vector<Value> from;
    Value to;
    Conv conv;
    std::string name;
    Buffer<float> weight, bias;  // [to][from][kernel][kernel], [to]; the bias is empty where there is none
  };

  // Weights are copied as layers are added. The source need not outlive this.
  Value input(int channels, Layout layout = Layout::blocked);
  // Takes NAME.weight and NAME.bias.
  Value conv(WeightSource& weights, const std::string& name, Value from, const Conv& conv);
  // Every pixel four times.
  Value upsample(Value from);
  // All but the last with a multiple of 16 channels; a value can be part of one concatenation.
  Value concat(const std::vector<Value>& from);
  // Keeps the value to the end of a run. `floats`: in float32 whatever the precision.
  void output(Value value, bool floats = false);

  const std::vector<Layer>& layers() const { return layers_; }
  const std::vector<Info>& values() const { return values_; }
  const Info& info(Value value) const { return values_[size_t(value.index)]; }
  const std::vector<Value>& inputs() const { return inputs_; }
  // The smallest number that sides of inputs must be multiples of.
  int alignment() const;

  // Arithmetic for a pixel of the inputs: a multiplication and an addition are two.
  double flopPerPixel() const;
  // The pixels of each input (in their order) that the given pixels of values depend on, along one axis.
  std::vector<Interval> reach(const std::map<int, Interval>& wanted) const;

 private:
  Value add(const Info& info);

  std::vector<Layer> layers_;
  std::vector<Info> values_;
  std::vector<Value> inputs_;
};

}  // namespace fathom::nn
