// The joint filter of the deep NL-Means denoiser: colour weights of pixels, feature weights of bins.
//
// Source: Vicini et al., sections 3 and 4.1 (equations 1 to 8). For a bin b of pixel p and a bin d of a pixel q in its
// window,
//   w = min(w_O(p, q), w_F(b, d)) * w_alpha(d),
// where the paper has min(w_O * w_alpha, w_F): measured a little better per bin. Feature distances are squared (the d_f
// of section 4.1 lacks its square) and clamped at 0. All candidates share the distances: k only scales the exponent, so
// the epsilon of equation 3 is scaled along with k_O. k_O = 1e4 is taken as infinity: such a candidate has feature
// weights only.
//
// Two blocks of data of each component are filtered side by side (the two half buffers; or albedo and normal), each
// with weights from its own guide or, crossed, from the other block's: then the weights do not know the noise of what
// they average.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "base/buffer.h"
#include "flat/box.h"
#include "flat/padded.h"

namespace fathom::deep {

inline constexpr int kMaxCandidates = 3;
inline constexpr int kMaxPatchRadius = 4;

struct JointFilterParams {
  int radius = 4;            // of the window: W = 2 radius + 1
  int patchRadius = 3;       // 0 to kMaxPatchRadius; w = 2 patchRadius + 1
  int candidates = 3;        // 1 to 3
  int colourCandidates = 2;  // 0 to 2: the first of them have colour weights, the others feature weights alone
  std::array<float, 2> kColour{0.45f, 0.6f};
  std::array<float, kMaxCandidates> kFeature{0.7f, 2.0f, 2.0f};
  float tau = 0.001f;
  float epsilon = 1e-10f;  // equation 3, added to variances, for colours whose mean is about 0.5
  bool crossed = true;
};

// One channel of a feature: values and variances of the mean by bin, squared gradient of the flattened feature by
// pixel.
struct FeatureChannel {
  const float* value;
  const float* variance;
  const float* gradient2;
};

// The flattened data of one block, padded by radius + patchRadius, and its variance.
struct Guide {
  std::array<flat::Padded, 3> value;
};
struct GuideVariance {
  std::array<flat::Padded, 3> value;
};

struct FilterComponent {
  const float* data = nullptr;  // 8 per bin: (r, g, b, 1) * weight of block 0, then of block 1; weight 0: says nothing
  std::array<const Guide*, 2> guide{};
  std::array<const GuideVariance*, 2> variance{};  // the same for both where the blocks are halves
};

struct JointFilterInput {
  int width = 0, height = 0;
  int rowPhase = 0;                   // absolute row of the first one: fixes the tiles, whatever band of rows this is
  const uint64_t* offsets = nullptr;  // width * height + 1
  std::vector<FeatureChannel>
      features;  // any number of features of three channels up to two, then one of a single channel
  std::vector<FilterComponent> components;  // 1 or 2
  const uint8_t* skip = nullptr;            // per pixel, or none: where it is not 0 the sums stay 0
};

// The sums of one tile. For the i-th bin of the tile (rows in order), component c and candidate k, at(i, c, k) is 8
// values: sum of w * (r, g, b, 1) for block 0, then for block 1; own(i, c, k) is 2: the part of the sum of weights that
// the bin's own pixel has, by block.
struct FilterTile {
  Box box;  // in pixels of the input
  const float* sums;
  const float* ownWeights;
  int components, candidates;
  unsigned active;  // bit c: component c was filtered; the sums of the others mean nothing

  const float* at(size_t i, int c, int k) const { return sums + ((i * components + c) * candidates + k) * 8; }
  const float* own(size_t i, int c, int k) const { return ownWeights + ((i * components + c) * candidates + k) * 2; }
};

inline constexpr int kTileWidth = 32, kTileHeight = 16;

// Filters tile after tile in parallel. `active` tells which components a tile needs (bit mask; 0 skips it: `consume` is
// called all the same), `consume` takes the sums; both are called from several threads at once, never twice for a tile.
void jointFilter(const JointFilterInput& input, const JointFilterParams& params,
                 const std::function<unsigned(const Box&)>& active,
                 const std::function<void(const FilterTile&)>& consume);

}  // namespace fathom::deep
