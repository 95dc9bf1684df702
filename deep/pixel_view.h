// One deep pixel as a range of depths leaves it: the parts of its samples, and what each of them adds to the pixel.
#pragma once

#include <array>
#include <limits>
#include <span>
#include <vector>

#include "deep/depth_range.h"
#include "deep/image.h"
#include "deep/pixel_pieces.h"
#include "deep/sample_depths.h"

namespace fathom::deep {

// The parts that are left, in the order of their samples.
struct PixelParts {
  std::vector<size_t> sample;  // of the image
  std::vector<float> z, zBack, alpha, weight;
  std::vector<double> factor, seen;  // of premultiplied values; effective alpha
  size_t count = 0;                  // the vectors may have room for more
};

// The mean depths of what is seen, weighted by effective alpha; of the nearest where nothing is seen. What lies at
// infinity has no say beside others.
class MeanDepths {
 public:
  void put(const Range& range, double seen);
  float middle() const { return alpha_ > 0 ? float(middle_ / alpha_) : nearest_.z; }
  float back() const { return alpha_ > 0 ? float(back_ / alpha_) : nearest_.zBack; }

 private:
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  double middle_ = 0, back_ = 0, alpha_ = 0;
  Range nearest_{kInfinity, kInfinity};
};

// Holds one pixel at a time; meant to be used for one after the other, so that its scratch is allocated once. The image
// must outlive it. Points at the same depth are merged or not as flatten does it with the same image.
class PixelView {
 public:
  static constexpr size_t kTogether = 3;  // channels that are summed at once: a colour
  using Values = std::array<const float*, kTogether>;
  using Totals = std::array<double, kTogether>;

  // Throws Error where A or Z is missing.
  PixelView(const DeepImage& image, const DepthRange& range);

  // Finds the parts of a pixel. True where it is a usual one: they go from front to back and do not meet.
  bool set(size_t pixel);

  // Of a usual pixel: its alpha, and the sums of some composited channels.
  double compositeTidy(const Values& values, Totals& totals) const;

  // Finds all that there is to know about the pixel, usual or not: what follows. Throws Error where volumes overlap too
  // much (see checkOverlaps).
  void composite();
  const PixelParts& parts() const { return parts_; }
  double alpha() const { return sums_.alpha; }
  const MeanDepths& depths() const { return depths_; }

 private:
  // What compositing front to back adds up.
  struct Sums {
    double passed = 1, alpha = 0;

    // Returns the transmittance in front.
    double put(double alphaHere) {
      const double front = passed;
      alpha += front * alphaHere;
      passed = front * (1 - alphaHere);
      return front;
    }
  };
  void makeRoom(size_t samples);
  void weighTidy();
  void weighAny();

  const DeepImage& image_;
  RangeCut cut_;
  std::span<const float> alpha_;
  SampleDepths samples_;
  bool mergePoints_;
  size_t pixel_ = 0;
  bool tidy_ = true;
  PixelParts parts_;
  Sums sums_;
  MeanDepths depths_;
  PixelPieces pieces_;
};

}  // namespace fathom::deep
