// The graphs of the layered denoiser, under the names that its training gives them. What runs between them: nn/layers.h.
//
// Source: Munkberg and Hasselgren, "Neural Denoising with Layer Embeddings", appendix B in the size of section 6. Departures:
// relu instead of leaky relu; residual blocks and strided convolutions in the U-net (nn/unet) instead of pairs of
// convolutions and max-pooling; networks that take embedding and context together have their first layer in two parts,
// so that the context's is computed once a pixel.
#pragma once

#include "nn/graph.h"

namespace fathom::nn {

constexpr int kSampleInputs = 20;
constexpr int kEmbedding = 32;
constexpr int kMostLayers = 4;
constexpr int kLayerScales = 3;

// Inputs of samples to their embeddings (float32); an image of 1 x N samples.
struct EmbedGraph {
  Graph graph;
  Value inputs, embedding;
};

// The same, and the logits of a sample's share in each of kMostLayers layers, with the context of its pixel.
struct PartitionGraph {
  Graph graph;
  Value inputs, context, embedding, logits;
};

// Mean embeddings of pixels to what the partition and the kernels take of them: kEmbedding channels at full size, and at
// full, half and quarter size.
struct ContextGraph {
  Graph graph;
  Value mean, partition, kernel[kLayerScales];
};

// The embeddings of a layer, and the context, to the logits of its kernels: 25, and for the finest scale three more of the
// scales' shares.
struct KernelGraph {
  Graph graph;
  Value embedding, context, logits;
};

EmbedGraph embedGraph(WeightSource& weights);
PartitionGraph partitionGraph(WeightSource& weights);
ContextGraph contextGraph(WeightSource& weights, int width);
KernelGraph kernelGraph(WeightSource& weights, int scale);

}  // namespace fathom::nn
