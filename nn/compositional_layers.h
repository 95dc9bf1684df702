// The layers of the compositional denoiser, under the names that its training gives them.
//
// Source: kernel prediction at three scales over decomposed colours; the three parts run one after another, and share
// what they learned wherever they are used.
#pragma once

#include "nn/graph.h"

namespace fathom::nn {

constexpr int kInputPlanes = 24;

// Planes to features of the network's width.
struct EncoderGraph {
  Graph graph;
  Value planes, features;
};

// A colour, as log(1 + c), and its features, to the logits of the share that the first part has in it (3 channels), and the
// features of both parts.
struct DecomposeGraph {
  Graph graph;
  Value colour, features, mask, first, second;
};

// A colour, as log(1 + c), and its features, to the kernels' logits at full, half and quarter size: 25, and one more for
// the share of the coarser scale in the finer two.
struct DenoiseGraph {
  Graph graph;
  Value colour, features, kernel[3];
};

EncoderGraph encoderGraph(WeightSource& weights, int width);
DecomposeGraph decomposeGraph(WeightSource& weights, int width);
DenoiseGraph denoiseGraph(WeightSource& weights, int width);

}  // namespace fathom::nn
