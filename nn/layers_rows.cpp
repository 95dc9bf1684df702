#include "nn/layers_rows.h"

#include <algorithm>
#include <cstring>

#include "nn/layers_kernel.h"

namespace fathom::nn {

namespace {

constexpr size_t kChunk = 1024, kStep = 64;  // samples; the last of a row is filled up to a multiple of kStep
constexpr size_t kShareStride = kChunk + kStep;

// What a chunk works in.
struct Scratch {
  Buffer<float> planes = Buffer<float>(kSampleInputs * kChunk), shares, embedding;
  Buffer<std::byte> packed, context, arena;

  std::byte* room(Buffer<std::byte>& buffer, size_t bytes) {
    if (buffer.size() < bytes) buffer = Buffer<std::byte>(bytes);
    return buffer.data();
  }
};

size_t groupsOf(int channels, int block) {
  return size_t((channels + block - 1) / block);
}

// Whether an input tells of a light, or of all alike: inputs 0 to 2 are the diffuse light and 17 its deviation, 3 to 5 and
// 18 the specular light's.
bool belongs(size_t input, SampleLight light) {
  const bool diffuse = input < 3 || input == 17, specular = (input >= 3 && input < 6) || input == 18;
  return light == SampleLight::Both || !(light == SampleLight::Diffuse ? specular : diffuse);
}

// The inputs of samples with one light, filled up with zeros to `size`, as the networks take them.
const std::byte* pack(const LayersNet& net, const SampleRow& row, SampleLight light, size_t begin, size_t count,
                      size_t size, Scratch& scratch) {
  for (size_t p = 0; p < kSampleInputs; ++p) {
    float* to = scratch.planes.data() + p * size;
    std::fill(belongs(p, light) ? std::copy_n(row.plane(p) + begin, count, to) : to, to + size, 0.0f);
  }
  const size_t values = groupsOf(kSampleInputs, net.block()) * size_t(net.block()) * size;
  std::byte* packed = scratch.room(scratch.packed, values * bytesOf(net.element()));
  packPlanes(denseRows<const float>(scratch.planes.data(), kSampleInputs, 1, int(size)), 1, int(size), net.block(),
             net.element(), packed);
  return packed;
}

// The context of each sample's pixel.
const std::byte* gather(const LayersNet& net, const SampleRow& row, const ContextRow& context, size_t begin,
                        size_t count, size_t size, Scratch& scratch) {
  const size_t groups = groupsOf(kEmbedding, net.block()), bytes = size_t(net.block()) * bytesOf(net.element());
  std::byte* to = scratch.room(scratch.context, groups * size * bytes);
  size_t pixel = size_t(std::ranges::upper_bound(row.first, uint32_t(begin)) - row.first.begin()) - 1;
  for (size_t i = 0; i < count; ++i) {
    while (row.first[pixel + 1] <= begin + i) ++pixel;
    for (size_t g = 0; g < groups; ++g)
      std::memcpy(to + (g * size + i) * bytes, context.first + g * context.groupBytes + pixel * bytes, bytes);
  }
  for (size_t g = 0; g < groups; ++g) std::memset(to + (g * size + count) * bytes, 0, (size - count) * bytes);
  return to;
}

template <class Body>
void forChunks(const SampleRow& row, const Body& body) {
  for (size_t begin = 0; begin < row.count(); begin += kChunk) {
    const size_t count = std::min(kChunk, row.count() - begin);
    body(begin, count, (count + kStep - 1) / kStep * kStep);
  }
}

}  // namespace

void embedRow(const LayersNet& net, const SampleRow& row, SampleLight light, const ChunkBody& body) {
  Scratch scratch;
  forChunks(row, [&](size_t begin, size_t count, size_t size) {
    const std::byte* inputs[] = {pack(net, row, light, begin, count, size, scratch)};
    const auto plan = net.embed().plan(1, int(size));
    std::byte* arena = scratch.room(scratch.arena, plan->layout().bytes);
    plan->run(inputs, arena);
    const auto* embedding = reinterpret_cast<const float*>(Plan::result(*plan, arena, net.embedValues().embedding));
    body({begin, count, embedding, size * size_t(net.block())});
  });
}

void shareRow(const LayersNet& net, const SampleRow& row, SampleLight light, const ContextRow& context, int layers,
              const ChunkBody& body) {
  Scratch scratch;
  scratch.shares = Buffer<float>(size_t(layers) * kShareStride, 1.0f);
  if (layers == 1) {
    embedRow(net, row, light, [&](SampleChunk chunk) {
      chunk.shares = scratch.shares.data();
      body(chunk);
    });
    return;
  }
  const size_t groups = groupsOf(kEmbedding, net.block());
  scratch.embedding = Buffer<float>(groups * size_t(net.block()) * kChunk);
  forChunks(row, [&](size_t begin, size_t count, size_t size) {
    const std::byte* inputs[] = {pack(net, row, light, begin, count, size, scratch),
                                 gather(net, row, context, begin, count, size, scratch)};
    const auto plan = net.partition().plan(1, int(size));
    std::byte* arena = scratch.room(scratch.arena, plan->layout().bytes);
    plan->run(inputs, arena);
    const PartitionGraph& values = net.partitionValues();
    const size_t groupFloats = size * size_t(net.block());
    toFloats(Plan::result(*plan, arena, values.embedding), groups * groupFloats, net.element(),
             scratch.embedding.data());
    layerShares(reinterpret_cast<const float*>(Plan::result(*plan, arena, values.logits)), net.block(), count, layers,
                scratch.shares.data(), kShareStride);
    body({begin, count, scratch.embedding.data(), groupFloats, scratch.shares.data(), kShareStride});
  });
}

}  // namespace fathom::nn
