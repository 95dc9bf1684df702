// How far around a window the network looks.
#pragma once

#include <array>

#include "nn/compositional_layers.h"

namespace fathom::nn {

// Pixels around a window, multiples of the alignment, by how often its colour is split: 0, 1 or 2 times. What the window
// takes is followed through all parts before it is rounded, so that roundings do not add up.
struct Halos {
  std::array<int, 3> level{};    // of the features and the colour that are still to be split so often
  std::array<int, 3> encoder{};  // of the planes, where it is split so often in all
};

// Windows begin and end at multiples of `alignment`.
Halos halosOf(const EncoderGraph& encoder, const DecomposeGraph& decompose, const DenoiseGraph& denoise, int alignment);

}  // namespace fathom::nn
