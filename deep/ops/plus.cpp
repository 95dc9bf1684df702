#include "deep/ops/plus.h"

#include <vector>

#include "deep/ops/merge.h"
#include "deep/ops/sample_plan.h"
#include "deep/pixel_pieces.h"
#include "deep/tidy.h"

namespace fathom::deep {

namespace {

// Plans one pixel after the other.
class PixelEmission {
 public:
  explicit PixelEmission(const DeepImage& image)
      : image_(image), alpha_(image.get("A")), z_(image.get("Z")), zBack_(image.tryGet("ZBack")) {}

  void plan(size_t pixel, RowPlan& row) {
    first_ = size_t(image_.offsets[pixel]);
    const size_t count = image_.count(pixel);
    pieces_.set(z_.subspan(first_, count), zBack_.empty() ? zBack_ : zBack_.subspan(first_, count));
    pieces_.checkOverlaps(true, image_.dataWindow, pixel);
    row_ = &row;
    passed_ = 1;
    pieces_.visit(alpha_.subspan(first_, count), true, [this](const Piece& piece) { put(piece); });
  }

 private:
  void put(const Piece& piece) {
    shares_.clear();
    for (const Share& share : piece.shares)
      shares_.push_back({first_ + share.sample, float(passed_ * share.weight), float(share.part)});
    if (float(passed_) > 0) row_->mix(shares_, piece.range.z, piece.range.zBack, 0);
    passed_ *= 1 - piece.alpha;
  }

  const DeepImage& image_;
  std::span<const float> alpha_, z_, zBack_;
  PixelPieces pieces_;
  RowPlan* row_ = nullptr;
  size_t first_ = 0;
  double passed_ = 1;
  std::vector<RowPlan::Share> shares_;
};

}  // namespace

DeepImage emission(DeepImage image) {
  dropSampleStatistics(image);
  const size_t width = size_t(image.dataWindow.width());
  return mapRows(image, [&](int y, RowPlan& row) {
    PixelEmission pixel(image);
    const size_t first = size_t(y - image.dataWindow.y0) * width;
    for (size_t x = 0; x < width; ++x) {
      row.nextPixel();
      pixel.plan(first + x, row);
    }
  });
}

DeepImage plus(DeepImage image, DeepImage added) {
  std::vector<DeepImage> both;
  both.push_back(std::move(image));
  both.push_back(emission(std::move(added)));
  return merge(both);
}

}  // namespace fathom::deep
