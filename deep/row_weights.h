// Compositing a row of pixels: what each sample contributes to its pixel, decided once for all channels.
#pragma once

#include <span>
#include <vector>

#include "deep/image.h"
#include "deep/pixel_pieces.h"
#include "deep/sample_depths.h"

namespace fathom::deep {

// The depths that a pixel of many samples can stand for. Pieces at an infinite depth have no say where others are seen.
struct PixelDepths {
  float mean;     // of all that is seen, weighted by effective alpha; a volume stands for its middle
  float front;    // where the first sample with alpha begins
  float back;     // where the last one that is seen ends; an opaque volume ends where it begins
  float passing;  // the first depth behind which no more passes than was asked for; `back` where more does to the end
};

// How a row's pixels are made of its samples. Per sample from the row's first one; per pixel from its first one.
struct RowWeights {
  std::vector<double> premultiplied;  // per sample, the factor of premultiplied values
  std::vector<double> seen;           // per sample, its effective alpha: what it adds to the pixel's
  std::vector<double> alpha;          // per pixel
  std::vector<PixelDepths> depths;    // per pixel; all are the nearest Z where nothing has alpha, 0 in an empty pixel
};

// Holds one row at a time; meant to be used for one after the other, so that its scratch is allocated once. Samples may
// lie in any order and overlap: they are sorted, split and merged as `tidy` does; but points at the same depth are
// composited one after the other in an image of camera samples or of bins made of them (attribute fathom:spp, or
// channels of statistics), whose alphas count samples. Alphas and depths are as opacity() and usableRange() have them.
class RowCompositor {
 public:
  // `findEnds`: all of PixelDepths, not the mean alone. `passes`: the transmittance that PixelDepths::passing is about,
  // at least 0 and below 1. Throws Error where A or Z is missing. The image must outlive this.
  explicit RowCompositor(const DeepImage& image, bool findEnds = false, double passes = 0.5);

  // Pixels are counted from the image's first one. Throws Error where volumes overlap too much (see checkOverlaps). The
  // result stays until the next call.
  const RowWeights& composite(size_t firstPixel, size_t endPixel);

 private:
  struct Pixel;
  struct Ends;
  bool compositeTidy(size_t begin, size_t end, Pixel& result);
  void compositeAny(size_t pixel, size_t begin, size_t end, Pixel& sum, Ends& ends);
  void findEnds(size_t begin, size_t end, Ends& ends) const;

  const DeepImage& image_;
  std::span<const float> alpha_;
  SampleDepths depths_;
  bool mergePoints_, findEnds_;
  double passes_;
  size_t rowBegin_ = 0;  // the row's first sample
  PixelPieces pieces_;
  RowWeights row_;
};

}  // namespace fathom::deep
