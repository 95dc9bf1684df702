// Where the values of a graph lie in one arena: room is shared by values that are never needed at the same time.
#pragma once

#include <cstddef>
#include <vector>

#include "nn/graph.h"

namespace fathom::nn {

// One range of the arena, taken from layer `first` to layer `last`, both included.
struct Room {
  size_t offset = 0, bytes = 0;
  int first = 0, last = 0;
};

struct MemoryPlan {
  struct Place {
    int room = -1;      // -1: outside of the arena (an input)
    size_t offset = 0;  // of the value within the room
  };

  std::vector<Room> rooms;
  std::vector<Place> places;      // one a value
  std::vector<int> scratch;       // one a layer: its room, or -1
  std::vector<bool> addsInPlace;  // one a layer: its result lies where what is added to it lay
  size_t bytes = 0;               // of the arena

  size_t offsetOf(Value value) const {
    const Place& place = places[size_t(value.index)];
    return rooms[size_t(place.room)].offset + place.offset;
  }
};

// How values lie in memory on this machine.
struct ElementSizes {
  int block = 16;
  size_t valueBytes = 4;  // of those that are not `floats`
};

size_t channelsOf(const Graph::Info& info, int block);  // filled up to whole groups
size_t elementBytes(const Graph::Info& info, const ElementSizes& sizes);
// Of an image of height x width pixels at scale 1.
size_t bytesOf(const Graph::Info& info, const ElementSizes& sizes, int height, int width);

// `scratchBytes`: what each layer needs besides; may be empty. Offsets are multiples of 64.
MemoryPlan planMemory(const Graph& graph, int height, int width, const ElementSizes& sizes,
                      const std::vector<size_t>& scratchBytes);

}  // namespace fathom::nn
