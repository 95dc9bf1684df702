// What the layered network sees of a deep frame: 20 inputs for each sample, and what its filters spread.
//
// Source: Fathom's own; nn/train/samples.py makes the same for training. With c a sample's light divided by its alpha, e the
// exposure that brings the flattened frame to one brightness, and w the sample's share of its pixel:
//
//   0-2    log(1 + e c) of the diffuse light      3-5  of the specular light, which is all light where there is one kind
//   6-8    albedo (0.5 where there is none)       9-11 normal
//   12     z / (z + m), m the mean depth of the frame by weight
//   13     circle of confusion c / (|c| + 4)      14, 15  place on the lens
//   16     w
//   17, 18 log(1 + the relative deviation of the means of diffuse and specular light), at most that of 8; 0 where unknown. Of a
//          bin that is of its own means, of a camera sample of its pixel's means, over all samples of that
//   19     log2(1 + n) / 8, n the camera samples in a bin
//
// Camera samples and bins are both taken so. A sample of alpha 0, or with a colour or depth that is not finite, has no say.
#pragma once

#include <optional>
#include <vector>

#include "deep/image.h"
#include "deep/layer_inputs.h"
#include "flat/light.h"
#include "nn/layers.h"

namespace fathom::deep {

// What the whole frame decides.
struct LayerScale {
  float exposure = 1;                          // see flat/neural_planes
  float depth = 1;                             // the mean by weight
  std::optional<flat::LightCurve> light = {};  // what the denoised light is multiplied by, where that is known
  // What goes through the network apart: diffuse light, divided by the albedo, and specular light, as far as there is any.
  std::vector<nn::SampleLight> lights = {nn::SampleLight::Both};
};

// Made from the rows of a frame, in any pieces from the top.
class LayerScaleSum {
 public:
  explicit LayerScaleSum(const Box& dataWindow);
  // Throws Error by the name of a channel that is missing.
  void add(const DeepImage& rows, const LayerInputs& inputs);
  LayerScale result() const;

 private:
  Box dataWindow_;
  Buffer<float> light_;  // [3][height][width]
  double depth_ = 0, weight_ = 0;
  bool diffuse_ = false, specular_ = false;  // whether there is any
};

// A row as the network takes it.
struct LayerRow {
  nn::SampleRow samples;
  std::vector<uint64_t> places;  // of its samples, in the planes of the image
  Buffer<float> render;          // of each pixel the brightness of these, the mean of R, G and B
  // Of each pixel the light of samples without alpha, R G B, as it comes through what is before them; and the nearest depth
  // of any of these.
  Buffer<float> emission, emissionDepth;
  std::vector<uint32_t> nonFinite;  // of each pixel the samples with alpha whose colour or depth is not finite
};

// Row y (of the data window's) of rows sorted front to back, which have the channels that `inputs` tells.
LayerRow layerRow(const DeepImage& rows, const LayerInputs& inputs, const LayerScale& scale, int y);

}  // namespace fathom::deep
