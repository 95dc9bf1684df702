// The near and far planes on an axis of depths: where they are, how they follow a hand, how they sweep. No widget here.
//
// Places are those of DepthAxis: 0 and 1 are the ends of what is shown. A plane at infinity is open; its handle stands
// at the end of the axis, and a handle that is moved there becomes open.
#pragma once

#include "deep/depth_axis.h"
#include "deep/depth_range.h"

namespace fathom::gui {

enum class ClipHandle { None, Near, Far, Slab };

class ClipModel {
 public:
  const deep::DepthAxis& whole() const { return whole_; }  // all depths of the picture
  const deep::DepthAxis& shown() const { return shown_; }  // the part that is looked at
  bool isZoomed() const { return !(shown_ == whole_); }

  // What is shown stays as it is, if it was a part and some of it is left; what was all becomes all again.
  void setWhole(const deep::DepthAxis& whole);
  // The part becomes `factor` times as long, with the depth at `place` where it is; never longer than all.
  void zoom(double place, double factor);
  void pan(double places);
  // The depths from near to far with some room, where both are finite.
  void show(const deep::DepthRange& range);
  void showAll() { shown_ = whole_; }

  // Where the handles stand; beyond 0 and 1 where they are not seen.
  double nearPlace(const deep::DepthRange& range) const;
  double farPlace(const deep::DepthRange& range) const;
  // What there is to grab at a place. Handles have their bodies outside of the range, `reach` long, so that they can be
  // told apart where the planes meet; between them is the slab, unless both are open.
  ClipHandle handleAt(double place, double reach, const deep::DepthRange& range) const;
  // `start` with a handle moved by so many places. A plane stops before the other one.
  deep::DepthRange moved(ClipHandle handle, const deep::DepthRange& start, double by) const;

 private:
  double openedNear(double place) const;
  double openedFar(double place) const;

  deep::DepthAxis whole_, shown_;
};

// Planes on their way through all depths and back: the slab where both are finite, else the one that is, or the near one.
class ClipSweep {
 public:
  // Begins at `start` and goes deeper.
  ClipSweep(const deep::DepthAxis& whole, const deep::DepthRange& start);
  deep::DepthRange at(double seconds) const;

 private:
  deep::DepthAxis axis_;
  deep::DepthRange start_;
  double begin_, end_;  // where the plane that leads may be, in places
  double width_ = 0;    // of the slab
  bool moveNear_, moveFar_;
  double offset_;  // of the time, in seconds
};

}  // namespace fathom::gui
