// Applied, the fog in front of a sample that hides a of what is behind it is seen by the part a of the rays that end
// there: with T passing the fog, a sample of the colour c becomes T c + a (1 - T) fog. What passes all samples sees
// all of the fog.
#include "deep/ops/fog.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "deep/ops/fog_slabs.h"
#include "deep/ops/merge.h"
#include "deep/ops/sample_plan.h"
#include "deep/piece_depth.h"
#include "deep/pixel_pieces.h"
#include "deep/tidy.h"

namespace fathom::deep {

namespace {

constexpr const char* kColours[] = {"R", "G", "B"};

struct Slab {
  float z, zBack, alpha;
};

// The slabs of a row of pixels; `counts` receives how many each has.
std::vector<Slab> slabsOfRow(const DeepImage& image, const FogParams& params, int y, uint64_t* counts) {
  FogSlabs fog(image, params);
  std::vector<Slab> row;
  for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x) {
    fog.set(x, y);
    const auto borders = fog.borders();
    const auto depths = fog.depths();
    for (size_t i = 0; i + 1 < borders.size(); ++i)
      row.push_back({borders[i], borders[i + 1], float(-std::expm1(depths[i] - depths[i + 1]))});
    *counts++ = borders.empty() ? 0 : borders.size() - 1;
  }
  return row;
}

// Plans one pixel after the other.
class PixelFog {
 public:
  PixelFog(const DeepImage& image, const FogParams& params)
      : image_(image), alpha_(image.get("A")), z_(image.get("Z")), zBack_(image.tryGet("ZBack")), fog_(image, params) {}

  // `light` receives, for each sample of the row, the part of the fog's colour that is added to it.
  void plan(int x, int y, RowPlan& row, std::vector<float>& light) {
    const size_t pixel = image_.dataWindow.index(x, y), count = image_.count(pixel);
    first_ = size_t(image_.offsets[pixel]);
    fog_.set(x, y);
    pieces_.set(z_.subspan(first_, count), zBack_.empty() ? zBack_ : zBack_.subspan(first_, count));
    pieces_.checkOverlaps(true, image_.dataWindow, pixel);
    row_ = &row;
    light_ = &light;
    passed_ = 1;
    end_ = -std::numeric_limits<float>::infinity();
    pieces_.visit(alpha_.subspan(first_, count), true, [this](const Piece& piece) { put(piece); });
    addRest();
  }

 private:
  void put(const Piece& piece) {
    const size_t count = pieces_.order().size();
    const auto backs = zBack_.empty() ? zBack_ : zBack_.subspan(first_, count);
    const double depth = opticalDepthOf(piece, alpha_.subspan(first_, count), z_.subspan(first_, count), backs);
    const double passing = fog_.passing(piece.range, depth);
    light_->push_back(float(piece.alpha * (1 - passing)));
    if (piece.whole && passing == 1) {
      row_->keep(first_ + piece.largest);
    } else {
      shares_.clear();
      for (const Share& share : piece.shares)
        shares_.push_back({first_ + share.sample, float(passing * share.weight), float(share.part)});
      row_->mix(shares_, piece.range.z, piece.range.zBack, float(piece.alpha));
    }
    passed_ *= 1 - piece.alpha;
    end_ = piece.range.zBack;
  }

  // The fog that is seen where the samples end no ray.
  void addRest() {
    if (fog_.borders().empty() || passed_ == 0) return;
    const float alpha = float(-std::expm1(-fog_.depths().back()));
    const float z = std::max(fog_.borders().back(), std::nextafter(end_, std::numeric_limits<float>::infinity()));
    row_->mix({}, z, z, alpha);
    light_->push_back(alpha);
  }

  const DeepImage& image_;
  std::span<const float> alpha_, z_, zBack_;
  FogSlabs fog_;
  PixelPieces pieces_;
  RowPlan* row_ = nullptr;
  std::vector<float>* light_ = nullptr;
  size_t first_ = 0;
  double passed_ = 1;
  float end_ = 0;
  std::vector<RowPlan::Share> shares_;
};

}  // namespace

DeepImage fogVolumes(const DeepImage& image, const FogParams& params) {
  const Box& window = image.dataWindow;
  DeepImage result{window, image.displayWindow, Buffer<uint64_t>(window.area() + 1, 0), {}, image.attributes};
  const FogSlabs checked(image, params);  // throws where they do not do, with or without rows
  std::vector<std::vector<Slab>> rows(size_t(window.height()));
  const auto first = [&](int row) { return size_t(row) * size_t(window.width()); };
  parallelFor(0, window.height(), [&](int row) {
    rows[size_t(row)] = slabsOfRow(image, params, window.y0 + row, result.offsets.data() + first(row) + 1);
  });
  for (size_t i = 0; i < window.area(); ++i) result.offsets[i + 1] += result.offsets[i];
  for (const char* name : {"R", "G", "B", "A", "Z", "ZBack"}) result.add(name, PixelType::Float);
  float* colours[] = {result.get("R").data(), result.get("G").data(), result.get("B").data()};
  float *alpha = result.get("A").data(), *z = result.get("Z").data(), *zBack = result.get("ZBack").data();
  parallelFor(0, window.height(), [&](int row) {
    size_t i = size_t(result.offsets[first(row)]);
    for (const Slab& slab : rows[size_t(row)]) {
      for (size_t c = 0; c < 3; ++c) colours[c][i] = params.colour[c] * slab.alpha;
      alpha[i] = slab.alpha;
      z[i] = slab.z;
      zBack[i++] = slab.zBack;
    }
  });
  return result;
}

DeepImage insertFog(DeepImage image, const FogParams& params) {
  std::vector<DeepImage> both;
  both.push_back(std::move(image));
  both.push_back(fogVolumes(both[0], params));
  return merge(both);
}

DeepImage applyFog(DeepImage image, const FogParams& params) {
  const FogSlabs checked(image, params);  // throws where they do not do, with or without rows
  dropSampleStatistics(image);
  image.attributes.erase("fathom:spp");
  const Box& window = image.dataWindow;
  std::vector<std::vector<float>> light(size_t(window.height()));
  DeepImage result = mapRows(image, [&](int y, RowPlan& row) {
    PixelFog pixel(image, params);
    for (int x = window.x0; x < window.x1; ++x) {
      row.nextPixel();
      pixel.plan(x, y, row, light[size_t(y - window.y0)]);
    }
  });
  parallelFor(0, window.height(), [&](int row) {
    const size_t begin = size_t(result.offsets[size_t(row) * size_t(window.width())]);
    const std::vector<float>& added = light[size_t(row)];
    for (size_t c = 0; c < 3; ++c)
      if (Channel* channel = result.find(kColours[c]); channel && channel->type != PixelType::Uint)
        for (size_t i = 0; i < added.size(); ++i)
          if (added[i] > 0) channel->values[begin + i] += params.colour[c] * added[i];
  });
  return result;
}

}  // namespace fathom::deep
