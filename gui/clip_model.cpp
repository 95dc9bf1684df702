#include "gui/clip_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fathom::gui {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr double kLeastGap = 0.002;      // between planes that are dragged, in places
constexpr double kShortest = 1e-5;       // of all depths that can be shown
constexpr double kRoom = 0.15;           // beside a range that is shown, in lengths of it
constexpr double kSecondsThrough = 4.0;  // of a sweep, one way

}  // namespace

void ClipModel::setWhole(const deep::DepthAxis& whole) {
  const bool isLeft = shown_.near < whole.far && shown_.far > whole.near;
  if (!isZoomed() || !isLeft || whole.logarithmic != whole_.logarithmic) shown_ = whole;
  whole_ = whole;
}

void ClipModel::zoom(double place, double factor) {
  const double length = whole_.place(shown_.far) - whole_.place(shown_.near);
  const double wanted = std::clamp(factor, kShortest / length, 1 / length);
  deep::DepthAxis next = shown_;
  next.near = shown_.depth(place - place * wanted);
  next.far = shown_.depth(place + (1 - place) * wanted);
  if (!(next.near < next.far)) return;
  if (length * wanted > 1 - 1e-9) return showAll();
  shown_ = next;
  pan(0);
}

void ClipModel::pan(double places) {
  const double first = shown_.place(whole_.near), last = shown_.place(whole_.far);
  const double by = std::clamp(places, first, std::max(first, last - 1));
  if (by == 0) return;
  const deep::DepthAxis before = shown_;
  shown_.near = std::max(before.depth(by), whole_.near);
  shown_.far = std::min(before.depth(1 + by), whole_.far);
}

void ClipModel::show(const deep::DepthRange& range) {
  if (!std::isfinite(range.near) || !std::isfinite(range.far) || !(range.near < range.far)) return;
  const double near = whole_.place(double(range.near)), far = whole_.place(double(range.far));
  const double begin = std::max(0.0, near - kRoom * (far - near)), end = std::min(1.0, far + kRoom * (far - near));
  if (end - begin < kShortest) return;
  shown_.near = whole_.depth(begin);
  shown_.far = whole_.depth(end);
}

double ClipModel::nearPlace(const deep::DepthRange& range) const {
  return range.near == -kInfinity ? std::max(0.0, shown_.place(whole_.near)) : shown_.place(double(range.near));
}

double ClipModel::farPlace(const deep::DepthRange& range) const {
  return range.far == kInfinity ? std::min(1.0, shown_.place(whole_.far)) : shown_.place(double(range.far));
}

ClipHandle ClipModel::handleAt(double place, double reach, const deep::DepthRange& range) const {
  const double near = nearPlace(range), far = farPlace(range), inner = reach / 3;
  const bool atNear = place >= near - reach && place <= near + inner;
  const bool atFar = place >= far - inner && place <= far + reach;
  if (atNear && atFar) return place < (near + far) / 2 ? ClipHandle::Near : ClipHandle::Far;
  if (atNear) return ClipHandle::Near;
  if (atFar) return ClipHandle::Far;
  const bool open = range.near == -kInfinity && range.far == kInfinity;
  return !open && place > near && place < far ? ClipHandle::Slab : ClipHandle::None;
}

double ClipModel::openedNear(double place) const {
  return place <= shown_.place(whole_.near) + 1e-9 ? -double(kInfinity) : shown_.depth(place);
}

double ClipModel::openedFar(double place) const {
  return place >= shown_.place(whole_.far) - 1e-9 ? double(kInfinity) : shown_.depth(place);
}

deep::DepthRange ClipModel::moved(ClipHandle handle, const deep::DepthRange& start, double by) const {
  deep::DepthRange range = start;
  const double near = nearPlace(start), far = farPlace(start);
  if (handle == ClipHandle::Near) {
    range.near = float(openedNear(std::min(near + by, far - kLeastGap)));
  } else if (handle == ClipHandle::Far) {
    range.far = float(openedFar(std::max(far + by, near + kLeastGap)));
  } else if (handle == ClipHandle::Slab) {
    const double first = shown_.place(whole_.near), last = shown_.place(whole_.far);
    // As long as a bit of it is over the axis; an end that is open stays so.
    const double shift = std::clamp(by, std::min(0.0, first - far + kLeastGap), std::max(0.0, last - near - kLeastGap));
    if (start.near != -kInfinity) range.near = float(shown_.depth(near + shift));
    if (start.far != kInfinity) range.far = float(shown_.depth(far + shift));
  }
  return range;
}

ClipSweep::ClipSweep(const deep::DepthAxis& whole, const deep::DepthRange& start)
    : axis_(whole),
      start_(start),
      begin_(0),
      end_(1),
      moveNear_(start.near != -kInfinity || start.far == kInfinity),
      moveFar_(start.far != kInfinity) {
  const double near = std::clamp(axis_.place(double(start.near)), 0.0, 1.0);
  const double far = std::clamp(axis_.place(double(start.far)), 0.0, 1.0);
  if (moveNear_ && moveFar_) {
    width_ = far - near;
    end_ = std::max(0.0, 1 - width_);
  }
  const double now = std::clamp(moveNear_ ? near : far, begin_, end_);
  offset_ = end_ > begin_ ? (now - begin_) / (end_ - begin_) * kSecondsThrough : 0;
}

deep::DepthRange ClipSweep::at(double seconds) const {
  const double turns = std::fmod((seconds + offset_) / kSecondsThrough, 2.0);
  const double place = begin_ + (end_ - begin_) * (1 - std::abs(1 - turns));
  deep::DepthRange range = start_;
  if (moveNear_) range.near = float(axis_.depth(place));
  if (moveFar_) range.far = float(axis_.depth(place + width_));
  return range;
}

}  // namespace fathom::gui
