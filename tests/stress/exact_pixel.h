// One deep pixel in long double: what is seen of each of its samples, up to any depth.
//
// The equation of transfer over stretches in which nothing begins or ends, in closed form. A volume of alpha a is
// extinction u = -ln(1 - a) over its length and the source that makes it alone give its colour; what overlaps adds up.
// Optical depths are summed and never multiplied out, so no alpha is ever formed of several. Points at one depth are a
// volume that they fill together, in front of those that begin there. Of what is opaque in one place each shows an equal
// part of itself, at its front, and all else there nothing. Unusable numbers are as DATA.md has them.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "deep/channels.h"
#include "deep/image.h"

namespace fathom::stress {

using Real = long double;
inline constexpr Real kForever = std::numeric_limits<Real>::infinity();

inline Real usable(float value) {
  return std::abs(value) <= 1e15f ? Real(value) : Real(0);
}

struct Medium {
  Real z, zBack, depth, alpha;  // depth: optical; a point where zBack <= z
  Medium(float front, float back, float opacity)
      : z(std::isnan(front) ? kForever : Real(front)), zBack(back > front ? Real(back) : z) {
    if (!std::isfinite(z) || !std::isfinite(zBack)) zBack = z;
    alpha = opacity > 0 ? std::min(Real(opacity), Real(1)) : Real(0);
    depth = -std::log1p(-alpha);
  }
  bool isPoint() const { return zBack <= z; }
};

// The mean transmittance of an optical depth, and so alpha / depth.
inline Real meanPassing(Real depth) {
  return depth == 0 ? 1 : -std::expm1(-depth) / depth;
}

class ExactPixel {
 public:
  explicit ExactPixel(std::vector<Medium> media, bool mergePoints = true) : media_(std::move(media)) {
    std::vector<size_t> order(media_.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return media_[a].z < media_[b].z; });
    std::vector<Real> borders;
    for (const Medium& medium : media_) borders.insert(borders.end(), {medium.z, medium.zBack});
    std::sort(borders.begin(), borders.end());
    borders.erase(std::unique(borders.begin(), borders.end()), borders.end());
    std::vector<size_t> active;
    size_t next = 0;
    for (size_t b = 0; b < borders.size(); ++b) {
      std::vector<size_t> points;
      for (; next < order.size() && media_[order[next]].z == borders[b]; ++next)
        (media_[order[next]].isPoint() ? points : active).push_back(order[next]);
      if (mergePoints && !points.empty()) add(borders[b], borders[b], points);
      for (size_t i = 0; !mergePoints && i < points.size(); ++i) add(borders[b], borders[b], {points[i]});
      std::erase_if(active, [&](size_t i) { return media_[i].zBack <= borders[b]; });
      if (!active.empty()) add(borders[b], borders[b + 1], active);
    }
  }

  // Through all that stands in front of a depth; points there are not in front.
  Real passing(Real until = kForever) const {
    Real depth = 0;
    for (const Stretch& stretch : stretches_)
      if (const Real part = reached(stretch, until); part > 0) depth += stretch.depth * part;
    return std::exp(-depth);
  }
  Real passingAll() const { return std::exp(-depthOfAll()); }
  Real alphaOfAll() const { return -std::expm1(-depthOfAll()); }

  // Through the points at a depth, too: what reaches a volume that begins there.
  Real passingPoints(Real at) const {
    Real depth = 0;
    for (const Stretch& stretch : stretches_)
      if (stretch.from == at && stretch.to == at) depth += stretch.depth;
    return passing(at) * std::exp(-depth);
  }

  // The mean of where things are seen, each stretch in its middle; those at infinity have no say. None where nothing is.
  std::optional<Real> meanDepth() const {
    Real depth = 0, sum = 0;
    for (const Stretch& stretch : stretches_) {
      if (!std::isfinite(stretch.from)) continue;
      const Real seen = std::exp(-stretch.before) * -std::expm1(-stretch.depth);
      depth += seen * (stretch.from + stretch.to) / 2, sum += seen;
    }
    return sum > 0 ? std::optional(depth / sum) : std::nullopt;
  }

  // What is seen of each sample in front of a depth, or of all: factors of premultiplied values.
  std::vector<Real> factors(Real until = kForever, bool all = true) const {
    std::vector<Real> result(media_.size(), 0);
    visit(until, all, [&](size_t i, Real factor) { result[i] += factor; });
    return result;
  }
  // Effective alphas.
  std::vector<Real> seen(Real until = kForever, bool all = true) const {
    std::vector<Real> result(media_.size(), 0);
    visit(until, all, [&](size_t i, Real factor) { result[i] += factor * media_[i].alpha; });
    return result;
  }
  // Of the light, `values` being those of the samples.
  Real light(std::span<const float> values, Real until, bool all) const {
    Real sum = 0;
    visit(until, all, [&](size_t i, Real factor) { sum += factor * usable(values[i]); });
    return sum;
  }
  const std::vector<Medium>& media() const { return media_; }

 private:
  Real depthOfAll() const { return stretches_.empty() ? 0 : stretches_.back().before + stretches_.back().depth; }
  struct Stretch {
    Real from, to, before, depth;  // optical depth before it and of it
    size_t opaque;                 // samples
    std::vector<size_t> media;
  };

  static Real reached(const Stretch& stretch, Real until) {
    if (!(stretch.from < until)) return 0;
    return stretch.opaque > 0 || stretch.to <= until ? Real(1) : (until - stretch.from) / (stretch.to - stretch.from);
  }
  Real fraction(const Stretch& stretch, size_t i) const {
    return media_[i].isPoint() ? 1 : (stretch.to - stretch.from) / (media_[i].zBack - media_[i].z);
  }
  void add(Real from, Real to, const std::vector<size_t>& media) {
    Stretch stretch{from, to, 0, 0, 0, media};
    if (!stretches_.empty()) stretch.before = stretches_.back().before + stretches_.back().depth;
    for (const size_t i : media) {
      stretch.opaque += media_[i].alpha == 1;
      stretch.depth += fraction(stretch, i) * media_[i].depth;
    }
    stretches_.push_back(std::move(stretch));
  }
  template <class Visit>
  void visit(Real until, bool all, const Visit& visit) const {
    for (const Stretch& stretch : stretches_) {
      const Real part = all ? 1 : reached(stretch, until), passing = std::exp(-stretch.before);
      if (part == 0 || passing == 0) continue;
      for (const size_t i : stretch.media) {
        const Medium& medium = media_[i];
        if (stretch.opaque > 0)
          visit(i, medium.alpha == 1 ? passing / Real(stretch.opaque) : 0);
        else
          visit(i,
                passing * part * fraction(stretch, i) * meanPassing(stretch.depth * part) / meanPassing(medium.depth));
      }
    }
  }

  std::vector<Medium> media_;
  std::vector<Stretch> stretches_;
};

inline std::vector<Medium> mediaOf(const deep::DeepImage& image, size_t pixel) {
  const auto z = image.get("Z"), zBack = image.tryGet("ZBack"), alpha = image.get("A");
  std::vector<Medium> media;
  for (size_t s = image.offsets[pixel]; s < image.offsets[pixel + 1]; ++s)
    media.emplace_back(z[s], zBack.empty() ? z[s] : zBack[s], alpha[s]);
  return media;
}

// As compositing takes the image.
inline ExactPixel exactPixel(const deep::DeepImage& image, size_t pixel) {
  return ExactPixel(mediaOf(image, pixel), !deep::holdsStatistics(image));
}

inline std::span<const float> valuesOf(const deep::DeepImage& image, size_t pixel, const char* channel) {
  return image.get(channel).subspan(image.offsets[pixel], image.count(pixel));
}

// The scale of a pixel's errors: the sum of its samples' magnitudes, at least the smallest normal float.
inline Real magnitude(std::span<const float> values) {
  Real sum = std::numeric_limits<float>::min();
  for (const float value : values) sum += std::abs(usable(value));
  return sum;
}

}  // namespace fathom::stress
