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

#include "base/parallel.h"
#include "deep/image.h"

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
  // Samples of the source that follow each other there and here.
  struct Run {
    uint64_t from;       // the first one in the source
    uint32_t at, count;  // the first one in this row, and how many they are
  };
  struct Made {
    uint32_t at;  // its number in this row
    uint32_t firstShare;
    float z, zBack, alpha;  // of a point: zBack == z
  };

  void nextPixel() { firsts_.push_back(samples_); }
  // A sample of the source as it is, bit for bit.
  void keep(uint64_t sample) {
    if (kept_.empty() || kept_.back().at + kept_.back().count != samples_ ||
        kept_.back().from + kept_.back().count != sample)
      kept_.push_back({sample, samples_, 0});
    ++kept_.back().count;
    ++samples_;
  }
  // A sample of the source with other depths, alpha and weight of its values.
  void change(uint64_t sample, float z, float zBack, float alpha, float weight) {
    make(z, zBack, alpha);
    shares_.push_back({sample, weight, 1});
  }
  // One made of several; `shares` are copied. Without any its values are 0, and only its depths and alpha say something.
  void mix(std::span<const Share> shares, float z, float zBack, float alpha) {
    make(z, zBack, alpha);
    shares_.insert(shares_.end(), shares.begin(), shares.end());
  }

  size_t samples() const { return samples_; }
  // The first sample of each pixel.
  std::span<const uint32_t> firsts() const { return firsts_; }
  // Together these are the row's samples, each in order.
  std::span<const Run> kept() const { return kept_; }
  std::span<const Made> made() const { return made_; }
  // What the i-th one made is made of.
  std::span<const Share> shares(size_t i) const {
    const size_t begin = made_[i].firstShare, end = i + 1 < made_.size() ? made_[i + 1].firstShare : shares_.size();
    return {shares_.data() + begin, end - begin};
  }

 private:
  void make(float z, float zBack, float alpha) {
    made_.push_back({samples_++, uint32_t(shares_.size()), z, zBack, alpha});
  }

  uint32_t samples_ = 0;
  std::vector<uint32_t> firsts_;
  std::vector<Run> kept_;
  std::vector<Made> made_;
  std::vector<Share> shares_;
};

// The image that `rows` describe: one plan per row of `window`, each of window.width() pixels. Display window,
// attributes and channels are the source's. Where a plan's sample is a volume, the source must have ZBack. Non-finite
// premultiplied values count as 0 where they are not passed on whole, and sums end at 1e15.
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
