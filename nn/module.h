// A graph made ready to run on this machine by oneDNN.
//
// Every run uses one thread; many may go on at once, each with an arena of its own. Which bits come out depends on the
// machine, the precision and the size, and on nothing else.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/buffer.h"
#include "nn/blocked.h"
#include "nn/graph.h"
#include "nn/memory_plan.h"

namespace fathom::nn {

// What convolutions multiply in; they always add in float32. `automatic` takes bfloat16 where the processor multiplies it
// faster.
enum class Precision { automatic, float32, bfloat16 };

// How many channels a group has on this machine: 16 with AVX-512, otherwise 8.
int machineBlock();
bool machineHasBfloat16();
Element elementFor(Precision precision);

class Module;

// A graph for images of one size: its primitives and its arena. It must not outlive its module.
class Plan {
 public:
  ~Plan();
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;

  int height() const { return height_; }
  int width() const { return width_; }
  const MemoryPlan& layout() const { return layout_; }

  // `inputs`: in the graph's order, each dense in its layout, in the module's element type. `arena`: layout().bytes,
  // aligned to 64. An output's value is then at result(arena, value).
  void run(std::span<const std::byte* const> inputs, std::byte* arena) const;
  static const std::byte* result(const Plan& plan, const std::byte* arena, Value value) {
    return arena + plan.layout_.offsetOf(value);
  }

  // For measurements: which of oneDNN's implementations each convolution got, and one layer alone.
  std::string implementation(size_t layer) const;
  void runLayer(size_t layer, std::span<const std::byte* const> inputs, std::byte* arena) const;

 private:
  friend class Module;
  struct Step;
  Plan(const Module& module, int height, int width);

  const Module& module_;
  int height_, width_;
  std::vector<std::unique_ptr<Step>> steps_;  // one a layer
  MemoryPlan layout_;
};

class Module {
 public:
  explicit Module(Graph graph, Element element = Element::float32);
  ~Module();
  Module(const Module&) = delete;
  Module& operator=(const Module&) = delete;

  const Graph& graph() const { return graph_; }
  Element element() const { return element_; }
  ElementSizes sizes() const { return {block_, bytesOf(element_)}; }

  // For images of height x width, multiples of the graph's alignment. Plans are kept and shared; from any thread.
  std::shared_ptr<const Plan> plan(int height, int width) const;

 private:
  friend class Plan;
  struct Shared;

  Graph graph_;
  Element element_;
  int block_;
  std::unique_ptr<Shared> shared_;  // what plans have in common
};

}  // namespace fathom::nn
