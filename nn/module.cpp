#include "nn/module.h"

#include <omp.h>

#include <algorithm>
#include <cstring>
#include <list>
#include <map>
#include <mutex>
#include <oneapi/dnnl/dnnl.hpp>
#include <stdexcept>
#include <unordered_map>

namespace fathom::nn {

namespace {

using dnnl::memory;

constexpr size_t kMostPlans = 64;  // of a module

// oneDNN takes as many threads as OpenMP offers to the thread that calls it.
class OneThread {
 public:
  OneThread() : before_(omp_get_max_threads()) { omp_set_num_threads(1); }
  ~OneThread() { omp_set_num_threads(before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_;
};

dnnl::engine& cpu() {
  static dnnl::engine engine(dnnl::engine::kind::cpu, 0);
  return engine;
}

memory::data_type typeOf(Element element) {
  return element == Element::float32 ? memory::data_type::f32 : memory::data_type::bf16;
}

int64_t roundUp(int64_t value, int64_t step) {
  return (value + step - 1) / step * step;
}

// Weights with as many channels as the layers' filled-up inputs and outputs have: the others are 0.
Buffer<float> filledWeights(const Graph::Layer& layer, int64_t outputs, int64_t inputs) {
  const size_t taps = size_t(layer.conv.kernel) * size_t(layer.conv.kernel);
  const size_t given = layer.weight.size() / size_t(layer.conv.channels) / taps;
  Buffer<float> result(size_t(outputs * inputs) * taps, 0.0f);
  for (size_t o = 0; o < size_t(layer.conv.channels); ++o)
    std::copy_n(layer.weight.data() + o * given * taps, given * taps, result.data() + o * size_t(inputs) * taps);
  return result;
}

}  // namespace

int machineBlock() {
  const auto isa = unsigned(dnnl::get_effective_cpu_isa()), wide = unsigned(dnnl::cpu_isa::avx512_core);
  return (isa & wide) == wide ? 16 : 8;
}

bool machineHasBfloat16() {
  const auto isa = unsigned(dnnl::get_effective_cpu_isa()), wide = unsigned(dnnl::cpu_isa::avx512_core_bf16);
  return (isa & wide) == wide;
}

Element elementFor(Precision precision) {
  const bool half = precision == Precision::bfloat16 || (precision == Precision::automatic && machineHasBfloat16());
  return half ? Element::bfloat16 : Element::float32;
}

// Weights in the layouts that primitives ask for, made when a plan first needs them.
struct Module::Shared {
  struct Weights {
    memory::desc layout;
    Buffer<std::byte> values;
  };

  std::mutex guard;
  std::vector<std::list<Weights>> weights;  // of each layer
  std::vector<Buffer<float>> biases;        // of each layer, filled up
  std::map<std::pair<int, int>, std::shared_ptr<const Plan>> plans;

  // With the guard held.
  std::byte* weightsAs(const memory::desc& layout, size_t i, const Graph::Layer& layer) {
    for (Weights& known : weights[i])
      if (known.layout == layout) return known.values.data();
    const memory::dims sizes = layout.dims();
    Buffer<float> plain = filledWeights(layer, sizes[0], sizes[1]);
    Weights& made = weights[i].emplace_back(Weights{layout, Buffer<std::byte>(layout.get_size())});
    memory from({sizes, memory::data_type::f32, memory::format_tag::oihw}, cpu(), plain.data());
    memory to(layout, cpu(), made.values.data());
    dnnl::stream stream(cpu());
    dnnl::reorder(from, to).execute(stream, from, to);
    stream.wait();
    return made.values.data();
  }
};

struct Plan::Step {
  dnnl::convolution_forward convolution;
  memory::desc from, weights, bias, to, scratch;
  std::byte* weightValues = nullptr;
  float* biasValues = nullptr;
  std::string implementation;
};

namespace {

// Descriptions of memory for the values of a graph.
class Describer {
 public:
  Describer(const Module& module, int height, int width) : module_(module), height_(height), width_(width) {}

  memory::desc operator()(Value value) const {
    const Graph::Info& info = module_.graph().info(value);
    const int block = module_.sizes().block;
    const auto blocked = block == 16 ? memory::format_tag::nChw16c : memory::format_tag::nChw8c;
    return {{1, int64_t(channelsOf(info, block)), height_ / info.scale, width_ / info.scale},
            info.floats ? memory::data_type::f32 : typeOf(module_.element()),
            info.layout == Layout::planar ? memory::format_tag::nchw : blocked};
  }

 private:
  const Module& module_;
  int height_, width_;
};

dnnl::primitive_attr attributesOf(const Conv& conv) {
  dnnl::post_ops after;
  if (conv.add.given()) after.append_sum(1.0f);
  if (conv.activation == Activation::relu) after.append_eltwise(1.0f, dnnl::algorithm::eltwise_relu, 0.0f, 0.0f);
  if (conv.activation == Activation::sigmoid) after.append_eltwise(1.0f, dnnl::algorithm::eltwise_logistic, 0.0f, 0.0f);
  dnnl::primitive_attr attributes;
  attributes.set_post_ops(after);
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  return attributes;
}

dnnl::convolution_forward::primitive_desc describe(const Conv& conv, const memory::desc& from, const memory::desc& to,
                                                   Element element) {
  const int64_t pad = conv.kernel == 3 ? 1 : 0;
  const memory::dims strides = {conv.stride, conv.stride}, pads = {pad, pad};
  const memory::desc weights({to.dims()[1], from.dims()[1], conv.kernel, conv.kernel}, typeOf(element),
                             memory::format_tag::any);
  const memory::desc bias({to.dims()[1]}, memory::data_type::f32, memory::format_tag::x);
  constexpr auto kKind = dnnl::prop_kind::forward_inference;
  constexpr auto kDirect = dnnl::algorithm::convolution_direct;
  const dnnl::convolution_forward::desc desc =
      conv.bias ? dnnl::convolution_forward::desc(kKind, kDirect, from, weights, bias, to, strides, pads, pads)
                : dnnl::convolution_forward::desc(kKind, kDirect, from, weights, to, strides, pads, pads);
  return {desc, attributesOf(conv), cpu()};
}

}  // namespace

Plan::Plan(const Module& module, int height, int width) : module_(module), height_(height), width_(width) {
  const OneThread oneThread;
  const Describer described(module, height, width);
  std::vector<size_t> scratch;
  for (size_t i = 0; i < module.graph().layers().size(); ++i) {
    const Graph::Layer& layer = module.graph().layers()[i];
    auto step = std::make_unique<Step>();
    step->from = described(layer.from.front());
    step->to = described(layer.to);
    if (layer.kind == Graph::Kind::conv) {
      const auto primitive = describe(layer.conv, step->from, step->to, module.element());
      step->convolution = dnnl::convolution_forward(primitive);
      step->weights = primitive.weights_desc();
      step->bias = primitive.bias_desc();
      step->scratch = primitive.scratchpad_desc();
      step->implementation = primitive.impl_info_str();
      step->weightValues = module.shared_->weightsAs(step->weights, i, layer);
      step->biasValues = module.shared_->biases[i].data();
    }
    scratch.push_back(layer.kind == Graph::Kind::conv ? step->scratch.get_size() : 0);
    steps_.push_back(std::move(step));
  }
  layout_ = planMemory(module.graph(), height, width, module.sizes(), scratch);
}

Plan::~Plan() = default;

std::string Plan::implementation(size_t layer) const {
  return steps_[layer]->implementation;
}

void Plan::runLayer(size_t i, std::span<const std::byte* const> inputs, std::byte* arena) const {
  const Graph& graph = module_.graph();
  const Graph::Layer& layer = graph.layers()[i];
  const auto place = [&](Value value) {
    for (size_t k = 0; k < inputs.size(); ++k)
      if (graph.inputs()[k].index == value.index) return const_cast<std::byte*>(inputs[k]);
    return arena + layout_.offsetOf(value);
  };
  const Graph::Info& out = graph.info(layer.to);
  if (layer.kind == Graph::Kind::concat) return;  // its parts are where they belong
  if (layer.kind == Graph::Kind::upsample) {
    const int block = module_.sizes().block, scale = graph.info(layer.from.front()).scale;
    enlargeGroups(place(layer.from.front()), channelsOf(out, block) / size_t(block), height_ / scale, width_ / scale,
                  size_t(block) * elementBytes(out, module_.sizes()), place(layer.to));
    return;
  }
  const Step& step = *steps_[i];
  if (layer.conv.add.given() && !layout_.addsInPlace[i])
    std::memcpy(place(layer.to), place(layer.conv.add), bytesOf(out, module_.sizes(), height_, width_));
  std::unordered_map<int, memory> arguments = {{DNNL_ARG_SRC, memory(step.from, cpu(), place(layer.from.front()))},
                                               {DNNL_ARG_WEIGHTS, memory(step.weights, cpu(), step.weightValues)},
                                               {DNNL_ARG_DST, memory(step.to, cpu(), place(layer.to))}};
  if (layer.conv.bias) arguments.emplace(DNNL_ARG_BIAS, memory(step.bias, cpu(), step.biasValues));
  if (const int room = layout_.scratch[i]; room >= 0)
    arguments.emplace(DNNL_ARG_SCRATCHPAD, memory(step.scratch, cpu(), arena + layout_.rooms[size_t(room)].offset));
  dnnl::stream stream(cpu());
  step.convolution.execute(stream, arguments);
  stream.wait();
}

void Plan::run(std::span<const std::byte* const> inputs, std::byte* arena) const {
  const OneThread oneThread;
  for (size_t i = 0; i < steps_.size(); ++i) runLayer(i, inputs, arena);
}

Module::Module(Graph graph, Element element)
    : graph_(std::move(graph)), element_(element), block_(machineBlock()), shared_(std::make_unique<Shared>()) {
  shared_->weights.resize(graph_.layers().size());
  for (const Graph::Layer& layer : graph_.layers()) {
    Buffer<float>& bias =
        shared_->biases.emplace_back(layer.bias.empty() ? 0 : roundUp(layer.conv.channels, block_), 0.0f);
    std::copy(layer.bias.begin(), layer.bias.end(), bias.begin());
  }
}

Module::~Module() = default;

std::shared_ptr<const Plan> Module::plan(int height, int width) const {
  const int alignment = graph_.alignment();
  if (height <= 0 || width <= 0 || height % alignment || width % alignment)
    throw std::logic_error("a plan's sides are multiples of " + std::to_string(alignment));
  const std::lock_guard lock(shared_->guard);
  const auto found = shared_->plans.find({height, width});
  if (found != shared_->plans.end()) return found->second;
  if (shared_->plans.size() >= kMostPlans) shared_->plans.clear();
  std::shared_ptr<const Plan> plan(new Plan(*this, height, width));
  shared_->plans[{height, width}] = plan;
  return plan;
}

}  // namespace fathom::nn
