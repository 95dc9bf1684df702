#include "deep/joint_filter.h"

#include <tbb/enumerable_thread_specific.h>

#include <cstring>

#include "base/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "deep/joint_filter.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "flat/exp-inl.h"

#ifndef FATHOM_JOINT_FILTER_ONCE
#define FATHOM_JOINT_FILTER_ONCE
namespace fathom::deep {

// What one thread needs for one tile.
struct FilterScratch {
  static constexpr int kStride = kTileWidth + 32;
  static_assert(kStride >= kTileWidth + 2 * kMaxPatchRadius + 16);  // whole vectors of up to 16 floats
  Buffer<float> distance[2], across[2];  // per block: per-pixel distances, and their sums along rows
  Buffer<float> colourWeights;           // [component][dx][row][column][candidate][block]
  Buffer<float> centres;                 // [bin][feature channel]: value, variance, 1 / (channels * denominator)
  // Candidates with the same k_F share weights: slot[k] is the one of candidate k.
  std::array<float, kMaxCandidates> exponent{};
  std::array<size_t, kMaxCandidates> slot{};
  size_t exponents = 0;
  std::array<Buffer<float>, kMaxCandidates> featureWeights;  // [slot], over the bins of one row of the window
  Buffer<float> sums, own;
};

}  // namespace fathom::deep
#endif

HWY_BEFORE_NAMESPACE();
namespace fathom::deep {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Equation 3 without its maximum, per pixel of the tile and its patch border: mean over channels of the normalised
// squared distance between p and q = p + (dx, dy), for both blocks.
template <bool kSameVariance>
void PixelDistances(const FilterComponent& component, const Box& tile, const JointFilterParams& params, int dx, int dy,
                    FilterScratch& s) {
  const int patch = params.patchRadius;
  const hn::ScalableTag<float> d;
  const size_t N = hn::Lanes(d);
  const auto epsilon = hn::Set(d, params.epsilon);
  const auto third = hn::Set(d, 1.0f / 3);
  for (int y = tile.y0 - patch; y < tile.y1 + patch; ++y) {
    const size_t out = size_t(y - tile.y0 + patch) * FilterScratch::kStride;
    for (size_t i = 0; i < size_t(kTileWidth + 2 * patch); i += N) {
      const ptrdiff_t x = tile.x0 - patch + ptrdiff_t(i);
      auto d0 = hn::Zero(d), d1 = hn::Zero(d);
      for (int c = 0; c < 3; ++c) {
        const auto variance = [&](int block, auto& least, auto& scale) HWY_ATTR {
          const auto vp = hn::LoadU(d, component.variance[block]->value[c].row(y) + x);
          const auto vq = hn::LoadU(d, component.variance[block]->value[c].row(y + dy) + x + dx);
          least = hn::Add(vp, hn::Min(vp, vq));
          scale = hn::Div(third, hn::Add(epsilon, hn::Add(vp, vq)));
        };
        const auto distance = [&](int block, auto least, auto scale) HWY_ATTR {
          const auto p = hn::LoadU(d, component.guide[block]->value[c].row(y) + x);
          const auto q = hn::LoadU(d, component.guide[block]->value[c].row(y + dy) + x + dx);
          const auto e = hn::Sub(p, q);
          return hn::Mul(hn::Sub(hn::Mul(e, e), least), scale);
        };
        auto least = hn::Zero(d), scale = hn::Zero(d);
        variance(0, least, scale);
        d0 = hn::Add(d0, distance(0, least, scale));
        if constexpr (!kSameVariance) variance(1, least, scale);
        d1 = hn::Add(d1, distance(1, least, scale));
      }
      hn::StoreU(d0, d, s.distance[0].data() + out + i);
      hn::StoreU(d1, d, s.distance[1].data() + out + i);
    }
  }
}

// Sums along rows over the width of a patch.
void SumAcross(int rows, int patch, FilterScratch& s) {
  const hn::ScalableTag<float> d;
  const size_t N = hn::Lanes(d);
  for (int block = 0; block < 2; ++block) {
    for (int y = 0; y < rows; ++y) {
      const float* in = s.distance[block].data() + size_t(y) * FilterScratch::kStride;
      float* out = s.across[block].data() + size_t(y) * kTileWidth;
      for (size_t x = 0; x < size_t(kTileWidth); x += N) {
        auto sum = hn::Load(d, in + x);
        for (int i = 1; i <= 2 * patch; ++i) sum = hn::Add(sum, hn::LoadU(d, in + x + i));
        hn::Store(sum, d, out + x);
      }
    }
  }
}

// Sums down the patch, equations 2 and 3, and the weights of up to two candidates for both blocks, interleaved.
void ColourWeights(const JointFilterParams& params, int height, const FilterScratch& s, float* HWY_RESTRICT out) {
  const hn::ScalableTag<float> d;
  const size_t N = hn::Lanes(d);
  const int side = 2 * params.patchRadius + 1;
  const float mean = -1.0f / float(side * side);
  const auto k0 = hn::Set(d, mean / (params.kColour[0] * params.kColour[0]));
  const auto k1 = hn::Set(d, mean / (params.kColour[1] * params.kColour[1]));
  for (int y = 0; y < height; ++y) {
    for (size_t x = 0; x < size_t(kTileWidth); x += N) {
      const auto down = [&](int block) HWY_ATTR {
        const float* in = s.across[block].data() + size_t(y) * kTileWidth + x;
        auto sum = hn::Load(d, in);
        for (int i = 1; i < side; ++i) sum = hn::Add(sum, hn::Load(d, in + i * kTileWidth));
        return hn::Max(sum, hn::Zero(d));
      };
      const auto d0 = down(params.crossed ? 1 : 0), d1 = down(params.crossed ? 0 : 1);
      const auto a0 = flat::HWY_NAMESPACE::ExpNegative(d, hn::Mul(d0, k0));
      const auto a1 = flat::HWY_NAMESPACE::ExpNegative(d, hn::Mul(d1, k0));
      auto b0 = a0, b1 = a1;
      if (params.colourCandidates > 1) {
        b0 = flat::HWY_NAMESPACE::ExpNegative(d, hn::Mul(d0, k1));
        b1 = flat::HWY_NAMESPACE::ExpNegative(d, hn::Mul(d1, k1));
      }
      hn::StoreInterleaved4(a0, a1, b0, b1, d, out + (size_t(y) * kTileWidth + x) * 4);
    }
  }
}

// What the feature distances of one centre bin need, by channel: computed once, used for every row of the window.
void FeatureCentres(const JointFilterInput& in, const JointFilterParams& params, const Box& tile, FilterScratch& s) {
  const size_t channels = in.features.size();
  float* out = s.centres.data();
  for (int y = tile.y0; y < tile.y1; ++y) {
    for (int x = tile.x0; x < tile.x1; ++x) {
      const size_t pixel = size_t(y) * size_t(in.width) + size_t(x);
      for (size_t bin = size_t(in.offsets[pixel]); bin < size_t(in.offsets[pixel + 1]); ++bin) {
        for (size_t j = 0; j < channels; ++j, out += 3) {
          const FeatureChannel& c = in.features[j];
          const float v = c.variance[bin];
          const float size = j + 1 < channels ? 3 : 1;
          out[0] = c.value[bin];
          out[1] = v;
          out[2] = 1.0f / (size * std::max(params.tau, std::max(v, c.gradient2[pixel])));
        }
      }
    }
  }
}

// Equations 4 and 5 with the deep d_f of section 4.1: the weights of `count` bins from `first` on, seen from one
// centre.
template <int kTriples>
void FeatureWeights(const JointFilterInput& in, const float* HWY_RESTRICT centre, size_t first, size_t count,
                    FilterScratch& s) {
  const hn::ScalableTag<float> d;
  const size_t N = hn::Lanes(d);
  constexpr int kChannels = 3 * kTriples + 1;
  const float *value[kChannels], *variance[kChannels];
  for (int j = 0; j < kChannels; ++j) {
    value[j] = in.features[size_t(j)].value + first;
    variance[j] = in.features[size_t(j)].variance + first;
  }
  for (size_t i = 0; i < count; i += N) {
    const auto distance = [&](int j) HWY_ATTR {
      const auto e = hn::Sub(hn::LoadU(d, value[j] + i), hn::Set(d, centre[3 * j]));
      const auto here = hn::Set(d, centre[3 * j + 1]);
      const auto least = hn::Add(here, hn::Min(here, hn::LoadU(d, variance[j] + i)));
      return hn::Mul(hn::Sub(hn::Mul(e, e), least), hn::Set(d, centre[3 * j + 2]));
    };
    auto worst = hn::Max(distance(kChannels - 1), hn::Zero(d));
    for (int g = 0; g < kTriples; ++g)
      worst = hn::Max(worst, hn::Add(hn::Add(distance(3 * g), distance(3 * g + 1)), distance(3 * g + 2)));
    for (size_t k = 0; k < s.exponents; ++k) {
      const auto exponent = hn::Mul(worst, hn::Set(d, s.exponent[k]));
      hn::StoreU(flat::HWY_NAMESPACE::ExpNegative(d, exponent), d, s.featureWeights[k].data() + i);
    }
  }
}

// Equation 6's sums for one bin over one row of its window: kComponents x kCandidates vectors of 8 stay in registers.
template <int kComponents, int kCandidates, int kColour>
class RowSum {
  using D = hn::CappedTag<float, 8>;
  using V = hn::Vec<D>;
  static constexpr size_t kLanes = hn::MaxLanes(D());
  static constexpr size_t kParts = 8 / kLanes;

 public:
  // `weights`: colour weights of the centre pixel for the first q of the run, one component after another; `step`:
  // floats from one q to the next. Adds to sums (kComponents x kCandidates x 8).
  static void Add(const std::array<const float*, 2>& data, const uint64_t* HWY_RESTRICT offsets, size_t pixels,
                  size_t first, const std::array<const float*, 2>& weights, size_t step, const FilterScratch& s,
                  float* HWY_RESTRICT sums) {
    const D d;
    std::array<const float*, kCandidates> featureWeights;
    for (size_t k = 0; k < kCandidates; ++k) featureWeights[k] = s.featureWeights[s.slot[k]].data();
    V acc[kComponents][kCandidates][kParts];
    for (int c = 0; c < kComponents; ++c)
      for (int k = 0; k < kCandidates; ++k)
        for (size_t p = 0; p < kParts; ++p) acc[c][k][p] = hn::LoadU(d, sums + (c * kCandidates + k) * 8 + p * kLanes);
    for (size_t q = 0; q < pixels; ++q) {
      V colour[kComponents][std::max(kColour, 1)][kParts];
      for (int c = 0; c < kComponents; ++c)
        for (int k = 0; k < kColour; ++k)
          for (size_t p = 0; p < kParts; ++p) colour[c][k][p] = Spread(d, weights[size_t(c)] + q * step + 2 * k, p);
      for (size_t bin = size_t(offsets[q]); bin < size_t(offsets[q + 1]); ++bin) {
        for (size_t p = 0; p < kParts; ++p) {
          V value[kComponents];
          for (int c = 0; c < kComponents; ++c) value[c] = hn::LoadU(d, data[size_t(c)] + bin * 8 + p * kLanes);
          for (int k = 0; k < kCandidates; ++k) {
            const V feature = hn::Set(d, featureWeights[size_t(k)][bin - first]);
            for (int c = 0; c < kComponents; ++c) {
              const V w = k < kColour ? hn::Min(colour[c][k < kColour ? k : 0][p], feature) : feature;
              acc[c][k][p] = hn::MulAdd(w, value[c], acc[c][k][p]);
            }
          }
        }
      }
    }
    for (int c = 0; c < kComponents; ++c)
      for (int k = 0; k < kCandidates; ++k)
        for (size_t p = 0; p < kParts; ++p) hn::StoreU(acc[c][k][p], d, sums + (c * kCandidates + k) * 8 + p * kLanes);
  }

 private:
  // (a, a, a, a, b, b, b, b) of the two blocks' weights (a, b), or the half of that which part p is.
  static V Spread(D d, const float* HWY_RESTRICT pair, size_t p) {
#if HWY_TARGET != HWY_SCALAR
    if constexpr (kParts == 1) {
      const hn::Half<D> half;
      return hn::Combine(d, hn::Set(half, pair[1]), hn::Set(half, pair[0]));
    }
#endif
    return hn::Set(d, pair[2 * p / kParts]);
  }
};

template <int kComponents, int kCandidates, int kColour>
void SumRow(const JointFilterInput& in, const JointFilterParams& params, const std::array<int, 2>& which,
            const Box& tile, int dy, FilterScratch& s) {
  const int R = params.radius;
  const size_t width = size_t(in.width);
  constexpr size_t kSums = size_t(kComponents * kCandidates * 8);
  const std::array<const float*, 2> data{in.components[size_t(which[0])].data, in.components[size_t(which[1])].data};
  const size_t plane = size_t(kTileWidth) * kTileHeight * 4;
  const size_t perComponent = plane * size_t(2 * R + 1);
  const auto featureWeights = in.features.size() == 1   ? &FeatureWeights<0>
                              : in.features.size() == 4 ? &FeatureWeights<1>
                                                        : &FeatureWeights<2>;
  size_t local = 0;
  for (int y = tile.y0; y < tile.y1; ++y) {
    const int yq = y + dy;
    const bool inside = yq >= 0 && yq < in.height;
    for (int x = tile.x0; x < tile.x1; ++x) {
      const size_t pixel = size_t(y) * width + size_t(x);
      const size_t begin = size_t(in.offsets[pixel]), end = size_t(in.offsets[pixel + 1]);
      const size_t here = local;
      local += end - begin;
      if (!inside || begin == end || (in.skip && in.skip[pixel])) continue;
      const int x0 = std::max(0, x - R), x1 = std::min(in.width - 1, x + R);
      const uint64_t* offsets = in.offsets + size_t(yq) * width + size_t(x0);
      const size_t pixels = size_t(x1 - x0 + 1);
      const size_t first = size_t(offsets[0]), count = size_t(offsets[pixels]) - first;
      if (count == 0) continue;
      if (s.featureWeights[0].size() < count + 64)
        for (Buffer<float>& weights : s.featureWeights) weights = Buffer<float>(2 * count + 64);
      const size_t at = (size_t(y - tile.y0) * kTileWidth + size_t(x - tile.x0)) * 4 + size_t(x0 - x + R) * plane;
      const std::array<const float*, 2> weights{s.colourWeights.data() + at,
                                                s.colourWeights.data() + at + perComponent};
      for (size_t b = begin; b < end; ++b) {
        float* sums = s.sums.data() + (here + b - begin) * kSums;
        featureWeights(in, s.centres.data() + (here + b - begin) * 3 * in.features.size(), first, count, s);
        if (dy != 0) {
          RowSum<kComponents, kCandidates, kColour>::Add(data, offsets, pixels, first, weights, plane, s, sums);
          continue;
        }
        // The row of the centre, in three runs: what the own pixel adds to the weights is what SURE needs.
        float* own = s.own.data() + (here + b - begin) * kSums / 4;
        const size_t left = size_t(x - x0);
        const auto run = [&](size_t from, size_t to) HWY_ATTR {
          const std::array<const float*, 2> w{weights[0] + from * plane, weights[1] + from * plane};
          RowSum<kComponents, kCandidates, kColour>::Add(data, offsets + from, to - from, first, w, plane, s, sums);
        };
        run(0, left);
        for (size_t i = 0; i < kSums / 4; ++i) own[i] = sums[i * 4 + 3];
        run(left, left + 1);
        for (size_t i = 0; i < kSums / 4; ++i) own[i] = sums[i * 4 + 3] - own[i];
        run(left + 1, pixels);
      }
    }
  }
}

template <int kComponents>
auto ChooseSumRow(int candidates, int colour) {
  if (candidates == 1) return colour ? &SumRow<kComponents, 1, 1> : &SumRow<kComponents, 1, 0>;
  if (candidates == 2) {
    if (colour == 0) return &SumRow<kComponents, 2, 0>;
    return colour == 1 ? &SumRow<kComponents, 2, 1> : &SumRow<kComponents, 2, 2>;
  }
  if (colour == 0) return &SumRow<kComponents, 3, 0>;
  return colour == 1 ? &SumRow<kComponents, 3, 1> : &SumRow<kComponents, 3, 2>;
}

void FilterOneTile(const JointFilterInput& in, const JointFilterParams& params, const Box& tile, unsigned active,
                   FilterScratch& s) {
  std::array<int, 2> which{0, 0};
  int components = 0;
  for (int c = 0; c < int(in.components.size()); ++c)
    if (active >> c & 1) which[size_t(components++)] = c;
  if (components == 1) which[1] = which[0];
  const int patch = params.patchRadius;
  const size_t plane = size_t(kTileWidth) * kTileHeight * 4;
  const auto sumRow = components == 1 ? ChooseSumRow<1>(params.candidates, params.colourCandidates)
                                      : ChooseSumRow<2>(params.candidates, params.colourCandidates);
  FeatureCentres(in, params, tile, s);
  for (int dy = -params.radius; dy <= params.radius; ++dy) {
    if (tile.y1 + dy <= 0 || tile.y0 + dy >= in.height) continue;
    if (params.colourCandidates > 0) {
      for (int c = 0; c < components; ++c) {
        const FilterComponent& component = in.components[size_t(which[size_t(c)])];
        for (int dx = -params.radius; dx <= params.radius; ++dx) {
          if (component.variance[0] == component.variance[1])
            PixelDistances<true>(component, tile, params, dx, dy, s);
          else
            PixelDistances<false>(component, tile, params, dx, dy, s);
          SumAcross(tile.height() + 2 * patch, patch, s);
          ColourWeights(params, tile.height(), s,
                        s.colourWeights.data() +
                            (size_t(c) * size_t(2 * params.radius + 1) + size_t(dx + params.radius)) * plane);
        }
      }
    }
    sumRow(in, params, which, tile, dy, s);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::deep
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::deep {
namespace {

HWY_EXPORT(FilterOneTile);

size_t binsOf(const JointFilterInput& in, const Box& tile) {
  size_t bins = 0;
  for (int y = tile.y0; y < tile.y1; ++y) {
    const uint64_t* row = in.offsets + size_t(y) * size_t(in.width);
    bins += size_t(row[tile.x1] - row[tile.x0]);
  }
  return bins;
}

void shareExponents(const JointFilterParams& params, FilterScratch& s) {
  s.exponents = 0;
  for (size_t k = 0; k < size_t(params.candidates); ++k) {
    const float exponent = -1 / (params.kFeature[k] * params.kFeature[k]);
    size_t slot = 0;
    while (slot < s.exponents && s.exponent[slot] != exponent) ++slot;
    if (slot == s.exponents) s.exponent[s.exponents++] = exponent;
    s.slot[k] = slot;
  }
}

void prepareScratch(const JointFilterParams& params, size_t components, size_t sums, size_t centres, FilterScratch& s) {
  shareExponents(params, s);
  if (s.centres.size() < centres) s.centres = Buffer<float>(centres);
  const size_t rows = size_t(kTileHeight + 2 * params.patchRadius);
  if (s.distance[0].empty()) {
    for (int block = 0; block < 2; ++block) {
      s.distance[block] = Buffer<float>(rows * FilterScratch::kStride, 0.0f);
      s.across[block] = Buffer<float>(rows * kTileWidth, 0.0f);
    }
    s.colourWeights = Buffer<float>(components * size_t(2 * params.radius + 1) * kTileWidth * kTileHeight * 4, 0.0f);
  }
  if (s.sums.size() < sums) {
    s.sums = Buffer<float>(sums);
    s.own = Buffer<float>(sums / 4);
  }
  std::fill_n(s.sums.data(), sums, 0.0f);
  std::fill_n(s.own.data(), sums / 4, 0.0f);
}

}  // namespace

void jointFilter(const JointFilterInput& input, const JointFilterParams& params,
                 const std::function<unsigned(const Box&)>& active,
                 const std::function<void(const FilterTile&)>& consume) {
  // Tiles start at absolute rows that are multiples of their height, so that a band of rows has the tiles of the whole.
  const int phase = ((input.rowPhase % kTileHeight) + kTileHeight) % kTileHeight;
  const int across = (input.width + kTileWidth - 1) / kTileWidth;
  const int down = (input.height + phase + kTileHeight - 1) / kTileHeight;
  tbb::enumerable_thread_specific<FilterScratch> scratch;
  parallelFor(0, across * down, [&](int i) {
    const int x = i % across * kTileWidth, y = i / across * kTileHeight - phase;
    const Box tile = intersect({x, y, x + kTileWidth, y + kTileHeight}, {0, 0, input.width, input.height});
    const unsigned mask = active(tile);
    FilterScratch& s = scratch.local();
    int components = 0;
    for (unsigned m = mask; m; m &= m - 1) ++components;
    if (mask) {
      const size_t bins = binsOf(input, tile);
      prepareScratch(params, input.components.size(), bins * size_t(components * params.candidates * 8),
                     bins * input.features.size() * 3, s);
      HWY_DYNAMIC_DISPATCH(FilterOneTile)(input, params, tile, mask, s);
    }
    consume({tile, s.sums.data(), s.own.data(), components, params.candidates, mask});
  });
}

}  // namespace fathom::deep
#endif
