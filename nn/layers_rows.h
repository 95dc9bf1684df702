// Rows of samples through the layered denoiser's dense networks.
//
// A row goes in chunks that begin where it begins, so that the bits of its samples depend on that row alone.
#pragma once

#include <functional>

#include "nn/layers.h"

namespace fathom::nn {

// Samples [begin, begin + count) of a row.
struct SampleChunk {
  size_t begin = 0, count = 0;
  const float* embedding = nullptr;  // [groups][..][block], groups `groupFloats` apart
  size_t groupFloats = 0;
  const float* shares = nullptr;  // [layers][..], rows `shareStride` apart; null where they were not asked for
  size_t shareStride = 0;
};
using ChunkBody = std::function<void(const SampleChunk& chunk)>;

// What the partition takes of the contexts of a row of pixels: [groups][..][block], groups `groupBytes` apart.
struct ContextRow {
  const std::byte* first = nullptr;
  size_t groupBytes = 0;
};

void embedRow(const LayersNet& net, const SampleRow& row, SampleLight light, const ChunkBody& body);
// With the parts of each sample in `layers` layers.
void shareRow(const LayersNet& net, const SampleRow& row, SampleLight light, const ContextRow& context, int layers,
              const ChunkBody& body);

}  // namespace fathom::nn
