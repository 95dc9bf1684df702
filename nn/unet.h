// The U-net that Fathom's networks share, under the names that training gives its layers.
//
// Source: three scales of w, 2w and 4w channels with a residual block each, as in nn/train/model.py.
#pragma once

#include <string>

#include "nn/graph.h"

namespace fathom::nn {

// Of w, 2w and 4w channels, at full, half and quarter size.
struct UNetLevels {
  Value y0, y1, x2;
};

// Two convolutions NAME.0 and NAME.1, with what goes in added to what comes out.
Value residualBlock(Graph& graph, WeightSource& weights, const std::string& name, Value from, int channels);

// `in`: w channels, after their activation. Takes NAME.level0, down0, level1, down1, level2, up1, merge1, up0 and merge0.
UNetLevels unetLevels(Graph& graph, WeightSource& weights, const std::string& name, Value in, int w);

}  // namespace fathom::nn
