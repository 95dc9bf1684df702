// What the deep filter works on, made once from the channels of a frame.
//
// Source: Vicini et al., sections 4.1, 5.2 and 5.3. Everything here is of the value *not* premultiplied.
#pragma once

#include <array>
#include <vector>

#include "base/buffer.h"
#include "deep/denoise.h"
#include "deep/joint_filter.h"
#include "flat/finite.h"

namespace fathom::deep {

// Added to the albedo before the diffuse light is divided by it (section 5.2), and multiplied back with it.
inline constexpr float kAlbedoOffset = 0.03f;

// Camera samples per pixel where nothing tells.
inline constexpr int kAssumedSpp = 64;

// Bins with less effective alpha (emission, or behind something opaque) have no say and keep their colours: nothing of
// them is seen, and what little is seen of their neighbours must not be taken for theirs.
inline constexpr float kLeastShare = 1e-6f;

// A feature over all bins: up to three channels of values, and the variances of those means.
struct Feature {
  std::vector<Buffer<float>> value, variance;
  Buffer<float> own;  // per bin, once prefiltered: its own share of the weights; empty where not wanted
};

// One of the parts of the light that are filtered apart: effective irradiance, specular light, or the whole colour.
struct DenoiseComponent {
  std::string name;        // "diffuse", "specular", or "" for R G B
  bool perAlbedo = false;  // divided by albedo + kAlbedoOffset
  Buffer<float> data;      // per bin 8, see FilterComponent
  std::vector<Buffer<float>>
      variance;  // per channel and bin, of the mean; only without halves, and where the file tells
};

struct DenoiseData {
  int width = 0, height = 0, rowPhase = 0;
  const uint64_t* offsets = nullptr;
  bool halves = false;   // block 0 and 1 are half buffers; else block 0 has all samples and block 1 nothing
  Buffer<float> weight;  // per bin: its effective alpha, 0 where that is below kLeastShare
  Buffer<float> count;   // per bin: camera samples that fell in it
  std::vector<DenoiseComponent> components;
  Feature albedo, normal, depth;  // without channels where the file has none; depth is the logarithm
  uint64_t nonFinite = 0;         // bins with a colour that is not finite: no component has data of them

  size_t bins() const { return size_t(offsets[size_t(width) * size_t(height)]); }
};

// Reads the colours, weights and counts that the plan says are there, no features yet; throws Error by the name of a
// channel that is missing. `image` must outlive the result.
DenoiseData prepareColours(const DeepImage& image, const DenoiseInputs& inputs);

// Reads the features, but where skip[pixel] != 0: there they are never set nor read.
void prepareFeatures(const DeepImage& image, const DenoiseInputs& inputs, const Buffer<uint8_t>& skip,
                     DenoiseData& data);

}  // namespace fathom::deep
