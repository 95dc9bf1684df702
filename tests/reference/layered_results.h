// What the layered network with random weights makes of a frame, for tests.
#pragma once

#include "deep/layers.h"
#include "deep/layers_results.h"
#include "tests/reference/layered.h"

namespace fathom::reference {

inline nn::LayersNet randomNet() {
  return nn::LayersNet(nn::readWeights(safetensors(randomLayered(16, 4)), "random"));
}

struct LayeredFrame {
  flat::Image flat;
  deep::DeepImage layers, bins;
  deep::LayersCounts counts;
};

// A frame in one band.
inline LayeredFrame denoiseLayered(const deep::DeepImage& image, deep::LayersParams params = {}) {
  static const nn::LayersNet net = randomNet();
  LayeredFrame results;
  const deep::LayerSource source = deep::layerSource(image);
  const deep::LayerScale scale = deep::measureLayers(source, params);
  deep::denoiseLayers(
      net, params, source, scale, image.dataWindow.y0, image.dataWindow.y1,
      [&](const deep::LayeredRows& rows) {
        results.flat = deep::flattenedLayers(rows);
        results.layers = deep::layersImage(rows, image.attributes);
        results.bins = deep::inLayerColours(image.copy(), rows, source.inputs);
      },
      {}, &results.counts);
  return results;
}

}  // namespace fathom::reference
