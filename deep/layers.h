// The layered network on deep frames: a denoised flat frame, its layers as a deep image, and bins with their colours.
//
// Source: nn/layers.h; what it sees of samples is deep/layer_samples. A frame is read in pieces of rows: once for what
// the whole frame decides, and each band of it twice (four times where there are several, see denoiseLayers), so that
// what is held does not depend on how many samples a pixel has. A scaled frame is denoised alike to 1e-4 over twelve
// powers of ten; what light it lacks comes back (flat/light).
#pragma once

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "deep/layer_samples.h"
#include "nn/layers_band.h"

namespace fathom::deep {

// Where rows come from: sorted front to back, under our names; any, and as often as they are asked for.
struct LayerSource {
  Box dataWindow, displayWindow;
  LayerInputs inputs;
  std::function<DeepImage(int y0, int y1)> read;
  std::function<size_t(int y0, int y1)> bytes;  // that rows take when they are read
};

// Rows of an image in memory, which must outlive it.
LayerSource layerSource(const DeepImage& image);

struct LayersParams {
  int layers = 2;     // 1, 2 or 4
  size_t memory = 0;  // bytes that may be held beside the results; 0: as many as it likes
};

// Of all runs: tiles of all layers that were filtered, and that had nothing in them; samples without a finite colour or depth.
struct LayersCounts {
  uint64_t filtered = 0, skipped = 0, nonFinite = 0;
};

// Some rows of a frame, denoised.
struct LayeredRows {
  const nn::LayersBand& band;  // in which row 0 is the first of the data window
  const LayerScale& scale;
  Box frame, displayWindow;     // the frame's data window
  int y0, y1;                   // these rows of it
  Buffer<float> emission;       // [3][rows][width]: the light of samples without alpha
  Buffer<float> emissionDepth;  // [rows][width]
  Buffer<float> render;         // [rows][width]: the brightness of the noisy frame; NaN where samples are lost
  Buffer<float> factors;        // [rows][width]: what all light is to be multiplied by; empty: nothing

  // The brightness of all layers one over the other, with that of samples without alpha, before factors.
  float brightness(int y, int x) const;
};

LayerScale measureLayers(const LayerSource& source, const LayersParams& params, const Progress& progress = {});

// For LayerScale::light: denoises the whole frame to see what light it lacks (flat/light).
flat::LightCurve measureLight(const nn::LayersNet& net, const LayersParams& params, const LayerSource& source,
                              const LayerScale& scale, const Progress& progress = {});

// Rows [y0, y1) of the data window in bands, from the top; `take` gets each when it is done. Where the scale knows no
// light, that of a whole frame is measured first, which takes as long again unless it is one band; a part of a frame
// stays as the network makes it. The same bits for any number of threads; for other bands the same to within rounding.
// Throws Error where `memory` does not do, and Cancelled.
void denoiseLayers(const nn::LayersNet& net, const LayersParams& params, const LayerSource& source,
                   const LayerScale& scale, int y0, int y1, const std::function<void(const LayeredRows& rows)>& take,
                   const Progress& progress = {}, LayersCounts* counts = nullptr);

// The rows that denoiseLayers would take a whole frame in: a run over each of them gives the same bits.
std::vector<std::pair<int, int>> layersBands(const nn::LayersNet& net, const LayersParams& params,
                                             const LayerScale& scale, const Box& dataWindow);

// Bytes that bands of the least number of rows take, and bands of a whole frame, of one light or two.
size_t leastLayersBytes(const nn::LayersNet& net, int layers, int lights, const Box& dataWindow);
size_t mostLayersBytes(const nn::LayersNet& net, int layers, int lights, const Box& dataWindow);

}  // namespace fathom::deep
