// What the layers of a frame are made into: a flat frame, a deep image of the layers, or bins in their colours.
#pragma once

#include "deep/layers.h"
#include "flat/image.h"

namespace fathom::deep {

// R, G, B and A of the layers one over the other, with the light of samples without alpha.
flat::Image flattenedLayers(const LayeredRows& rows);

// At most a sample a layer: R, G, B (premultiplied), A and Z, ascending. Layers without alpha and colour are left out. The
// light of samples without alpha belongs to the first.
DeepImage layersImage(const LayeredRows& rows, const Attributes& attributes);

// Rows of an image of the same frame (all channels, sorted), in which R, G, B of each sample become the colours of the layers
// that it was split among: A times the sum over the layers of its part times colour / alpha. diffuse.* and specular.*, which
// would no longer add up, and what describes noise are left out. A sample that had no say keeps its colour if it has no
// alpha, and else gets that of all layers together.
DeepImage inLayerColours(DeepImage image, const LayeredRows& rows, const LayerInputs& inputs);

}  // namespace fathom::deep
