// A frame of random bins with all that the joint filter reads, for its tests and its benchmark.
#pragma once

#include <random>
#include <vector>

#include "deep/joint_filter.h"

namespace fathom::reference {

struct FrameShape {
  int width = 13, height = 11, rowPhase = 0;
  int mostBins = 3;  // 0 to that many in a pixel, and whole rows without any
  int components = 2;
  int triples = 2;  // features of three channels before depth
  bool sharedVariance = true;
};

// A frame of random bins, with everything that the filter reads.
class RandomFrame {
 public:
  RandomFrame(const FrameShape& shape, const deep::JointFilterParams& params, unsigned seed) : random_(seed) {
    const size_t pixels = size_t(shape.width) * size_t(shape.height);
    offsets_ = Buffer<uint64_t>(pixels + 1);
    offsets_[0] = 0;
    for (size_t p = 0; p < pixels; ++p) {
      const bool emptyRow = p / size_t(shape.width) % 5 == 3;
      offsets_[p + 1] = offsets_[p] + (emptyRow ? 0 : random_() % unsigned(shape.mostBins + 1));
    }
    const size_t bins = size_t(offsets_[pixels]);
    input_.width = shape.width;
    input_.height = shape.height;
    input_.rowPhase = shape.rowPhase;
    input_.offsets = offsets_.data();
    for (int f = 0; f < 3 * shape.triples + 1; ++f) {
      const float* value = fill(features_.emplace_back(bins), [&] { return 0.1f * normal(); });
      const float* variance = fill(features_.emplace_back(bins), [&] { return 0.01f * uniform() * uniform(); });
      const float* gradient = fill(features_.emplace_back(pixels), [&] { return 0.02f * uniform(); });
      input_.features.push_back({value, variance, gradient});
    }
    const int pad = params.radius + params.patchRadius;
    guides_.resize(size_t(2 * shape.components));
    variances_.resize(size_t(2 * shape.components));
    for (int c = 0; c < shape.components; ++c) {
      Buffer<float>& data = data_.emplace_back(8 * bins);
      for (size_t b = 0; b < bins; ++b)
        for (size_t h = 0; h < 2; ++h) {
          const float weight = random_() % 9 == 0 ? 0.0f : uniform();
          for (size_t i = 0; i < 3; ++i) data[8 * b + 4 * h + i] = weight * (0.5f + 0.3f * normal());
          data[8 * b + 4 * h + 3] = weight;
        }
      deep::FilterComponent component{data.data(), {}, {}};
      for (size_t h = 0; h < 2; ++h) {
        const size_t i = 2 * size_t(c) + h;
        for (size_t ch = 0; ch < 3; ++ch) {
          guides_[i].value[ch] = plane(shape, pad, [&] { return 0.5f + 0.2f * normal(); });
          variances_[i].value[ch] = plane(shape, pad, [&] { return 0.03f * uniform(); });
        }
        component.guide[h] = &guides_[i];
        component.variance[h] = &variances_[shape.sharedVariance ? 2 * size_t(c) : i];
      }
      input_.components.push_back(component);
    }
  }

  const deep::JointFilterInput& input() const { return input_; }

 private:
  float uniform() { return std::uniform_real_distribution<float>(0, 1)(random_); }
  float normal() { return std::normal_distribution<float>(0, 1)(random_); }
  template <class Value>
  static const float* fill(Buffer<float>& values, const Value& value) {
    for (float& v : values) v = value();
    return values.data();
  }
  template <class Value>
  static flat::Padded plane(const FrameShape& shape, int pad, const Value& value) {
    flat::Padded result(shape.width, shape.height, pad);
    for (int y = 0; y < shape.height; ++y)
      for (int x = 0; x < shape.width; ++x) result.row(y)[x] = value();
    result.extend();
    return result;
  }

  std::mt19937 random_;
  Buffer<uint64_t> offsets_;
  std::vector<Buffer<float>> features_, data_;
  std::vector<deep::Guide> guides_;
  std::vector<deep::GuideVariance> variances_;
  deep::JointFilterInput input_;
};

}  // namespace fathom::reference
