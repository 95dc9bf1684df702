// The samples of both images are brought into tidy pieces together. Of a piece that lets through what T leaves of the
// light in front, `image` is seen with alpha T * a, its share of the piece's. To be seen so behind its own samples,
// which leave 1 - (what is seen of them) = T + H, H being what is seen of the holdout in front, it needs the alpha
// a * T / (T + H), and its values that factor, too.
#include "deep/ops/holdout.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/ops/sample_plan.h"
#include "deep/piece_depth.h"
#include "deep/pixel_pieces.h"
#include "deep/sample_depths.h"
#include "deep/tidy.h"

namespace fathom::deep {

namespace {

struct Samples {
  const DeepImage& image;
  std::span<const float> alpha;
  SampleDepths depths;

  explicit Samples(const DeepImage& of) : image(of), alpha(of.get("A")), depths(of) {}
};

// The samples of one pixel, from `next` on.
struct Run {
  size_t next, end;

  bool empty() const { return next == end; }
};

Run runAt(const DeepImage& image, int x, int y) {
  if (!image.dataWindow.contains(x, y)) return {0, 0};
  const size_t pixel = image.dataWindow.index(x, y);
  return {size_t(image.offsets[pixel]), size_t(image.offsets[pixel + 1])};
}

// Plans one pixel after the other.
class PixelHoldout {
 public:
  PixelHoldout(const Samples& image, const Samples& holdout) : image_(image), holdout_(holdout) {}

  void plan(int x, int y, RowPlan& row) {
    Run own = runAt(image_.image, x, y);
    gather(own, runAt(holdout_.image, x, y));
    if (!hides_) {
      for (; !own.empty(); ++own.next) row.keep(own.next);
      return;
    }
    pieces_.set(z_, zBack_);
    pieces_.checkOverlaps(true, image_.image.dataWindow, image_.image.dataWindow.index(x, y));
    row_ = &row;
    passed_ = 1;
    hidden_ = 0;
    pieces_.visit(alpha_, true, [this](const Piece& piece) { put(piece); });
  }

 private:
  static constexpr size_t kHoldout = ~size_t(0);

  // Both runs in one, in order where they are; of the holdout, what can hide something.
  void gather(Run own, Run other) {
    z_.clear(), zBack_.clear(), alpha_.clear(), from_.clear(), ranges_.clear();
    hides_ = false;
    float end = -std::numeric_limits<float>::infinity();
    for (size_t i = own.next; i < own.end; ++i) {
      ranges_.push_back(image_.depths[i]);
      end = std::max(end, ranges_.back().zBack);
    }
    size_t next = 0;
    const auto addOwn = [&] {
      add(ranges_[next], image_.alpha[own.next + next], own.next + next);
      ++next;
    };
    for (; !other.empty(); ++other.next) {
      const Range range = holdout_.depths[other.next];
      while (next < ranges_.size() && ranges_[next].z <= range.z) addOwn();
      if (opacity(holdout_.alpha[other.next]) == 0 || range.z > end) continue;
      hides_ = true;
      add(range, holdout_.alpha[other.next], kHoldout);
    }
    while (hides_ && next < ranges_.size()) addOwn();
  }

  void add(const Range& range, float alpha, size_t from) {
    z_.push_back(range.z);
    zBack_.push_back(range.zBack);
    alpha_.push_back(alpha);
    from_.push_back(from);
  }

  void put(const Piece& piece) {
    const double seen = hidden_ > 0 ? passed_ / (passed_ + hidden_) : 1;
    shares_.clear();
    double part = 0, hidden = 0;  // of the piece's opacity: the image's own, and the holdout's
    bool visible = false;
    for (const Share& share : piece.shares) {
      if (from_[share.sample] == kHoldout) {
        hidden += share.part;
        continue;
      }
      shares_.push_back({from_[share.sample], float(seen * share.weight), float(share.part)});
      part += share.part;
      visible |= shares_.back().weight > 0;
    }
    if (piece.whole && seen == 1 && visible)
      row_->keep(shares_[0].sample);
    else if (visible)
      mix(piece, seen, part);
    hidden_ += passed_ * piece.alpha * hidden;
    passed_ *= 1 - piece.alpha;
  }

  void mix(const Piece& piece, double seen, double part) {
    for (RowPlan::Share& share : shares_) share.part = part > 0 ? float(share.part / part) : 1 / float(shares_.size());
    row_->mix(shares_, piece.range.z, piece.range.zBack, float(piece.alpha * part * seen));
  }

  const Samples& image_;
  const Samples& holdout_;
  bool hides_ = false;
  std::vector<Range> ranges_;  // of the image's own samples
  std::vector<float> z_, zBack_, alpha_;
  std::vector<size_t> from_;  // the sample's number in `image`, or kHoldout
  PixelPieces pieces_;
  RowPlan* row_ = nullptr;
  double passed_ = 1, hidden_ = 0;  // T and H
  std::vector<RowPlan::Share> shares_;
};

// Where the accumulated alpha of a pixel reaches a value: behind `z`, or, if `from`, there already.
struct Reached {
  double z;
  bool from;

  bool hides(float sample) const { return sample > z || (from && sample == z); }
};

// Finds that, pixel by pixel.
class PixelOpacity {
 public:
  // `opaque` is reached by what it is as a FLOAT, too.
  PixelOpacity(const Samples& samples, double opaque)
      : samples_(samples), least_(1 - std::min(opaque, double(float(opaque)))) {}

  std::optional<Reached> find(int x, int y) {
    const Run run = runAt(samples_.image, x, y);
    if (run.empty()) return {};
    const size_t count = run.end - run.next;
    z_ = samples_.depths.fronts(run.next, count);
    zBack_ = samples_.depths.backs(run.next, count);
    alpha_ = samples_.alpha.subspan(run.next, count);
    pieces_.set(z_, zBack_);
    pieces_.checkOverlaps(true, samples_.image.dataWindow, samples_.image.dataWindow.index(x, y));
    passed_ = 1;
    reached_.reset();
    pieces_.visit(alpha_, true, [this](const Piece& piece) { put(piece); });
    return reached_;
  }

 private:
  void put(const Piece& piece) {
    const double behind = passed_ * (1 - piece.alpha);
    if (!reached_ && behind <= least_) {
      const Range& range = piece.range;
      const double depth = opticalDepthOf(piece, alpha_, z_, zBack_);
      const double fraction =
          range.isPoint() || std::isinf(depth) ? 0 : std::min(1.0, std::log(passed_ / least_) / depth);
      reached_ = Reached{double(range.z) + fraction * (double(range.zBack) - double(range.z)), fraction > 0};
    }
    passed_ = behind;
  }

  const Samples& samples_;
  double least_;  // transmittance
  PixelPieces pieces_;
  std::span<const float> alpha_, z_, zBack_;  // of the pixel
  double passed_ = 1;
  std::optional<Reached> reached_;
};

}  // namespace

DeepImage holdout(DeepImage image, const DeepImage& holdout) {
  dropSampleStatistics(image);
  image.attributes.erase("fathom:spp");
  const Samples own(image), other(holdout);
  return mapRows(image, [&](int y, RowPlan& row) {
    PixelHoldout pixel(own, other);
    for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x) {
      row.nextPixel();
      pixel.plan(x, y, row);
    }
  });
}

DeepImage hardHoldout(const DeepImage& image, const DeepImage& holdout, double opaque) {
  if (!(opaque > 0 && opaque <= 1)) fail("holdout: expected an alpha above 0 and up to 1, found {}", opaque);
  const Samples own(image), other(holdout);
  return mapRows(image, [&](int y, RowPlan& row) {
    PixelOpacity opacity(other, opaque);
    for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x) {
      row.nextPixel();
      const std::optional<Reached> reached = opacity.find(x, y);
      for (Run run = runAt(image, x, y); !run.empty(); ++run.next)
        if (!reached || !reached->hides(own.depths[run.next].z)) row.keep(run.next);
    }
  });
}

flat::Image holdoutMatte(const DeepImage& image, const DeepImage& holdout) {
  DeepImage depths = image.copyLayout();
  for (const char* name : {"A", "Z", "ZBack"})
    if (const Channel* channel = image.find(name)) depths.add(name, channel->type).values = channel->values.copy();
  const flat::Image all = flatten(depths);
  flat::Image matte = flatten(deep::holdout(std::move(depths), holdout));
  std::erase_if(matte.planes, [](const flat::Plane& plane) { return plane.name != "A"; });
  const Buffer<float>& alpha = all.get("A").values;
  Buffer<float>& seen = matte.find("A")->values;
  for (size_t i = 0; i < seen.size(); ++i) seen[i] = alpha[i] > 0 ? std::min(seen[i] / alpha[i], 1.0f) : 1;
  return matte;
}

}  // namespace fathom::deep
