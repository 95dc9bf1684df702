#include "deep/ops/fog_slabs.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace fathom::deep {

namespace {

// The optical depth of a volume that its FLOAT alpha still tells well, inside of it, too: with 17 it would be opaque, and
// hide all from its front on. And that behind which nothing is seen.
constexpr double kThickest = 4, kBlind = 20;

// The mean of exp(-x) from 0 to `depth`.
double meanPassing(double depth) {
  return depth == 0 ? 1 : -std::expm1(-depth) / depth;
}

void check(const FogParams& params) {
  if (!std::isfinite(params.near) || !std::isfinite(params.far) || !(params.near < params.far))
    fail("fog: expected a finite depth near before a finite depth far, found {} and {}", params.near, params.far);
  if (!(params.density >= 0) || std::isinf(params.density))
    fail("fog: density: expected 0 or more, found {}", params.density);
  if (params.fieldOfView && !(*params.fieldOfView > 0 && *params.fieldOfView < 180))
    fail("fog: fov: expected degrees between 0 and 180, found {}", *params.fieldOfView);
  if (!params.height) return;
  if (!(params.height->falloff > 0)) fail("fog: falloff: expected more than 0, found {}", params.height->falloff);
  if (params.height->slabs < 1) fail("fog: slabs: expected 1 or more, found {}", params.height->slabs);
}

void checkCamera(const ViewRays& rays) {
  if (!rays.hasPlace()) fail("fog: height: expected the attribute worldToCamera, with an inverse, found none");
  if (!rays.hasScale())
    fail("fog: height: expected fov, or one of the attributes worldToNDC, fieldOfView, fathom:ppuScale, found none");
}

}  // namespace

FogSlabs::FogSlabs(const DeepImage& image, const FogParams& params)
    : params_((check(params), params)),
      rays_(image.attributes, image.displayWindow, params.fieldOfView, params.height ? params.height->up : Axis::Y) {
  if (params.height) checkCamera(rays_);
}

double FogSlabs::Stretch::depthWithin(double length) const {
  return densest * length * meanPassing(std::abs(rate) * length);
}

double FogSlabs::Stretch::lengthWithin(double depth) const {
  return rate == 0 ? depth / densest : -std::log1p(-std::abs(rate) * depth / densest) / std::abs(rate);
}

double FogSlabs::Stretch::depthBefore(double z) const {
  return rate >= 0 ? depthWithin(z - from) : depth() - depthWithin(to - z);
}

double FogSlabs::Stretch::where(double depth) const {
  return rate >= 0 ? from + lengthWithin(depth) : to - lengthWithin(this->depth() - depth);
}

void FogSlabs::findStretches(const ViewRay& ray) {
  stretches_.clear();
  const double full = params_.density * ray.length, near = params_.near, far = params_.far;
  if (!params_.height) {
    stretches_.push_back({near, far, full, 0});
    return;
  }
  const double height = params_.height->height, rate = ray.slope / params_.height->falloff;
  const auto above = [&](double z) { return ray.start + z * ray.slope - height; };
  const auto add = [&](double from, double to) {
    if (!(from < to)) return;
    const bool falls = above(from / 2 + to / 2) > 0;
    const double lowest = std::max(0.0, std::min(above(from), above(to)));
    stretches_.push_back(
        {from, to, falls ? full * std::exp(-lowest / params_.height->falloff) : full, falls ? rate : 0});
  };
  const double level = ray.slope == 0 ? near : std::clamp((height - ray.start) / ray.slope, near, far);
  add(near, level);
  add(level, far);
}

void FogSlabs::set(int x, int y) {
  findStretches(rays_.at(x, y));
  borders_.clear();
  depths_.clear();
  double all = 0;
  bool even = true;
  for (const Stretch& stretch : stretches_) {
    all += stretch.depth();
    even &= stretch.rate == 0;
  }
  if (!(all > 0)) return;
  wanted_.clear();
  const int slabs = even ? 1 : params_.height->slabs;
  for (int i = 1; i < slabs; ++i) wanted_.push_back(all * i / slabs);
  for (int i = 1; i * kThickest < std::min(all, kBlind + kThickest); ++i) wanted_.push_back(i * kThickest);
  std::sort(wanted_.begin(), wanted_.end());
  borders_.push_back(float(params_.near));
  depths_.push_back(0);
  double before = 0;  // of the stretches that are passed
  size_t k = 0;
  for (const double depth : wanted_) {
    while (k + 1 < stretches_.size() && depth > before + stretches_[k].depth()) before += stretches_[k++].depth();
    const float z = float(stretches_[k].where(depth - before));
    // Rounding may bring it to an end of the fog or, where that is thick beyond all measure, make it no number.
    if (!(z > borders_.back() && z < float(params_.far))) continue;
    borders_.push_back(z);
    depths_.push_back(std::clamp(before + stretches_[k].depthBefore(double(z)), depths_.back(), all));
  }
  borders_.push_back(float(params_.far));
  depths_.push_back(all);
}

double FogSlabs::depthTo(double z) const {
  if (borders_.empty() || z <= double(borders_.front())) return 0;
  if (z >= double(borders_.back())) return depths_.back();
  const size_t i = size_t(std::upper_bound(borders_.begin(), borders_.end(), z) - borders_.begin()) - 1;
  const double begin = borders_[i], end = borders_[i + 1];
  return depths_[i] + (z - begin) / (end - begin) * (depths_[i + 1] - depths_[i]);
}

double FogSlabs::passing(float z) const {
  return std::exp(-depthTo(double(z)));
}

double FogSlabs::passing(const Range& range, double own) const {
  if (range.isPoint() || std::isinf(own)) return passing(range.z);
  const double begin = range.z, end = range.zBack;
  double sum = 0, from = begin, inFront = depthTo(begin);
  auto border = std::upper_bound(borders_.begin(), borders_.end(), range.z);
  while (from < end) {
    const double to = border == borders_.end() ? end : std::min(end, double(*border++)), next = depthTo(to);
    const double part = (to - from) / (end - begin), before = inFront + own * (from - begin) / (end - begin);
    sum += std::exp(-before) * part * meanPassing(next - inFront + own * part);
    from = to;
    inFront = next;
  }
  return sum / meanPassing(own);
}

}  // namespace fathom::deep
