// Parts of a concatenation lie in its room, so that nobody copies them; a sum lies where one of its terms lay, if that
// has no later use. Rooms are then put in place from the largest to the smallest, each at the lowest offset that is
// free for as long as it lives.
#include "nn/memory_plan.h"

#include <algorithm>
#include <numeric>

namespace fathom::nn {

namespace {

constexpr size_t kAlign = 64;

size_t aligned(size_t bytes) {
  return (bytes + kAlign - 1) / kAlign * kAlign;
}

// The first layer that writes a value and the last that reads it.
struct Life {
  int first = 0, last = -1;
};

std::vector<Life> livesOf(const Graph& graph) {
  std::vector<Life> lives(graph.values().size());
  const int layers = int(graph.layers().size());
  for (int i = 0; i < layers; ++i) {
    const Graph::Layer& layer = graph.layers()[size_t(i)];
    lives[size_t(layer.to.index)] = {i, i};
    for (const Value& from : layer.from) lives[size_t(from.index)].last = i;
    if (layer.conv.add.given()) lives[size_t(layer.conv.add.index)].last = i;
  }
  for (size_t v = 0; v < lives.size(); ++v)
    if (graph.values()[v].output) lives[v].last = layers;
  return lives;
}

// Which value's room a value lies in, and where.
struct Host {
  int value = -1;
  size_t offset = 0;
};

class Planner {
 public:
  Planner(const Graph& graph, int height, int width, const ElementSizes& sizes)
      : graph_(graph), height_(height), width_(width), sizes_(sizes), lives_(livesOf(graph)), hosts_(lives_.size()) {
    plan_.addsInPlace.resize(graph.layers().size(), false);
    plan_.places.resize(lives_.size());
  }

  MemoryPlan plan(const std::vector<size_t>& scratchBytes) {
    for (size_t i = 0; i < graph_.layers().size(); ++i) findHosts(int(i), graph_.layers()[i]);
    makeRooms();
    for (size_t i = 0; i < graph_.layers().size(); ++i)
      addScratch(int(i), i < scratchBytes.size() ? scratchBytes[i] : 0);
    place();
    return std::move(plan_);
  }

 private:
  const Graph::Info& info(Value value) const { return graph_.info(value); }
  size_t bytes(Value value) const { return bytesOf(info(value), sizes_, height_, width_); }

  void findHosts(int i, const Graph::Layer& layer) {
    if (layer.kind == Graph::Kind::concat) {
      size_t offset = 0;
      for (const Value& from : layer.from) {
        hosts_[size_t(from.index)] = {layer.to.index, offset};
        offset += bytes(from);
      }
    }
    const Value term = layer.conv.add;
    if (!term.given() || info(term).input || hosts_[size_t(term.index)].value >= 0) return;
    if (lives_[size_t(term.index)].last != i || layer.from.front().index == term.index) return;
    if (elementBytes(info(term), sizes_) != elementBytes(info(layer.to), sizes_)) return;
    hosts_[size_t(term.index)] = {layer.to.index, 0};
    plan_.addsInPlace[size_t(i)] = true;
  }

  void makeRooms() {
    std::vector<int> roomOf(hosts_.size(), -1);
    for (size_t v = 0; v < hosts_.size(); ++v) {  // in the order of the layers that write them
      if (graph_.values()[v].input) continue;
      int host = int(v);
      size_t offset = 0;
      for (; hosts_[size_t(host)].value >= 0; host = hosts_[size_t(host)].value) offset += hosts_[size_t(host)].offset;
      int& index = roomOf[size_t(host)];
      if (index < 0) {
        index = int(plan_.rooms.size());
        plan_.rooms.push_back({0, aligned(bytes({host})), lives_[v].first, lives_[v].last});
      }
      Room& room = plan_.rooms[size_t(index)];
      room.last = std::max(room.last, lives_[v].last);
      plan_.places[v] = {index, offset};
    }
  }

  void addScratch(int layer, size_t needed) {
    plan_.scratch.push_back(needed ? int(plan_.rooms.size()) : -1);
    if (needed) plan_.rooms.push_back({0, aligned(needed), layer, layer});
  }

  void place() {
    std::vector<size_t> order(plan_.rooms.size());
    std::iota(order.begin(), order.end(), size_t(0));
    std::ranges::stable_sort(order, std::greater(), [&](size_t i) { return plan_.rooms[i].bytes; });
    std::vector<Room> placed;  // by offset
    for (const size_t i : order) {
      Room& room = plan_.rooms[i];
      for (const Room& other : placed) {
        if (other.last < room.first || room.last < other.first) continue;
        if (room.offset + room.bytes <= other.offset) break;
        room.offset = std::max(room.offset, other.offset + other.bytes);
      }
      placed.insert(std::ranges::upper_bound(placed, room.offset, {}, &Room::offset), room);
      plan_.bytes = std::max(plan_.bytes, room.offset + room.bytes);
    }
  }

  const Graph& graph_;
  int height_, width_;
  ElementSizes sizes_;
  std::vector<Life> lives_;
  std::vector<Host> hosts_;
  MemoryPlan plan_;
};

}  // namespace

size_t channelsOf(const Graph::Info& info, int block) {
  if (info.layout == Layout::planar) return size_t(info.channels);
  return size_t((info.channels + block - 1) / block * block);
}

size_t elementBytes(const Graph::Info& info, const ElementSizes& sizes) {
  return info.floats ? sizeof(float) : sizes.valueBytes;
}

size_t bytesOf(const Graph::Info& info, const ElementSizes& sizes, int height, int width) {
  return channelsOf(info, sizes.block) * elementBytes(info, sizes) * size_t(height / info.scale) *
         size_t(width / info.scale);
}

MemoryPlan planMemory(const Graph& graph, int height, int width, const ElementSizes& sizes,
                      const std::vector<size_t>& scratchBytes) {
  return Planner(graph, height, width, sizes).plan(scratchBytes);
}

}  // namespace fathom::nn
