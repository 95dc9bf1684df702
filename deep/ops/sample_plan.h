// Decide, then apply: which samples an image will have and what each is made of, found from depths and alphas alone,
// and then the channels, one after the other.
//
// What a merged value becomes follows the role of its channel (deep/channels): alpha and depths come from the plan;
// premultiplied values and half buffers are weighted sums; plain coordinates are means by part; identifiers are those
// of the sample with the largest part, bit for bit. Statistics go with the largest part, too: whoever merges or splits
// samples drops those channels first (see dropSampleStatistics).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "deep/image.h"
#include "flat/parallel.h"

namespace fathom::deep {

// What a row of an image becomes. Filled from left to right: begin each pixel with nextPixel(), then add its samples
// front to back.
class RowPlan {
 public:
  struct Share {
    uint64_t sample;  // of the source image
    float weight;     // factor of its premultiplied values
    float part;       // of the new sample's opacity; the parts of a sample sum to 1
  };
  struct Sample {
    uint32_t firstShare;
    bool whole;             // bit for bit as the one share's sample was: depths and alpha are not looked at
    float z, zBack, alpha;  // of a point: zBack == z
  };

  void nextPixel() { ends_.push_back(uint32_t(samples_.size())); }
  // A sample of the source as it is.
  void keep(uint64_t sample) { add({sample, 1, 1}, true, 0, 0, 0); }
  // A sample of the source with other depths, alpha and weight of its values.
  void change(uint64_t sample, float z, float zBack, float alpha, float weight) {
    add({sample, weight, 1}, false, z, zBack, alpha);
  }
  // One made of several; `shares` are copied. Without any its values are 0, and only its depths and alpha say something.
  void mix(std::span<const Share> shares, float z, float zBack, float alpha);

  size_t pixels() const { return ends_.size(); }
  size_t samples() const { return samples_.size(); }
  // The first of the samples of the i-th pixel; samples() for i == pixels().
  size_t first(size_t i) const { return i < ends_.size() ? ends_[i] : samples_.size(); }
  const Sample& sample(size_t i) const { return samples_[i]; }
  std::span<const Share> shares(size_t i) const {
    const size_t begin = samples_[i].firstShare;
    const size_t end = i + 1 < samples_.size() ? samples_[i + 1].firstShare : shares_.size();
    return {shares_.data() + begin, end - begin};
  }

 private:
  void add(const Share& share, bool whole, float z, float zBack, float alpha) {
    samples_.push_back({uint32_t(shares_.size()), whole, z, zBack, alpha});
    shares_.push_back(share);
  }

  std::vector<uint32_t> ends_;  // samples before each pixel
  std::vector<Sample> samples_;
  std::vector<Share> shares_;
};

// The image that `rows` describe: one plan per row of `window`, each of window.width() pixels. Display window,
// attributes and channels are the source's. Where a plan's sample is a volume, the source must have ZBack. Non-finite
// premultiplied values count as 0 where they are not passed on whole.
DeepImage applyPlan(const DeepImage& source, const Box& window, std::span<const RowPlan> rows);

// Plans the rows of an image in parallel, with plan(y, row) for each row of its data window, y absolute, and applies
// them; the window stays.
template <class Plan>
DeepImage mapRows(const DeepImage& source, const Plan& plan) {
  const Box& window = source.dataWindow;
  std::vector<RowPlan> rows(size_t(window.height()));
  parallelFor(0, window.height(), [&](int i) { plan(window.y0 + i, rows[size_t(i)]); });
  return applyPlan(source, window, rows);
}

}  // namespace fathom::deep
