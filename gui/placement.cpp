#include "gui/placement.h"

#include <algorithm>
#include <cstdlib>

#include "deep/ops/insert.h"
#include "deep/statistics.h"
#include "flat/error.h"

namespace fathom::gui {

namespace {

const deep::DeepImage& deepOf(const Picture& picture, const char* what) {
  if (!picture.deep()) fail("{}: expected a deep image {}, found a flat one", picture.path, what);
  return *picture.deep();
}

PlacedDepths depthsOf(const deep::DeepImage& image, const deep::DeepImage& volume) {
  deep::Statistics a, b;
  a.add(image);
  b.add(volume);
  PlacedDepths depths;
  if (a.nearest <= a.farthest) depths.nearest = a.nearest, depths.farthest = a.farthest;
  if (b.nearest <= b.farthest) depths.volumeNearest = b.nearest, depths.volumeFarthest = b.farthest;
  return depths;
}

int nearestOf(const std::vector<int>& frames, int frame) {
  return *std::ranges::min_element(frames, {}, [&](int other) { return std::abs(int64_t(other) - frame); });
}

}  // namespace

Placement::Placement(Session& session, Frames& frames, QObject* parent)
    : QObject(parent), session_(session), frames_(frames), read_(std::make_shared<Read>()) {
  // The picture without the volume is better than that of another frame.
  connect(&background_, &Background::failed, this, [this](const QString& line) {
    session_.say(line);
    session_.setA(a_);
    session_.setB(b_);
  });
}

Placement::~Placement() {
  if (volume_) frames_.setStage({}, {});
}

std::string Placement::file() const {
  return volume_ ? volume_->at(nearestOf(volume_->frames, frames_.player().frame())) : "";
}

void Placement::open(const QString& path) {
  try {
    volume_ = findSource(path, frames_.a() && frames_.a()->isSequence()).source;
  } catch (const Error& e) {
    return session_.say(QString::fromStdString(e.what()));
  }
  const auto stage = [this](const PicturePtr& a, const PicturePtr& b) {
    if (a != a_ || b != b_) background_.clear();
    a_ = a;
    b_ = b;
    place();
  };
  frames_.setStage(stage, [this] { return busy(); });
  emit changed();
}

void Placement::remove() {
  if (!volume_) return;
  volume_.reset();
  background_.clear();
  a_.reset();
  b_.reset();
  read_ = std::make_shared<Read>();
  frames_.setStage({}, {});
  emit changed();
}

void Placement::setTransform(const deep::Transform& transform) {
  try {
    transform.check();
  } catch (const Error& e) {
    return session_.say(QString::fromStdString(e.what()));
  }
  transform_ = transform;
  if (volume_ && a_) place();
  emit changed();
}

void Placement::place() {
  const auto work = [this, a = a_, b = b_, path = file(), transform = transform_,
                     read = read_](const Progress& progress) -> Background::Deliver {
    const deep::DeepImage& image = deepOf(*a, "to place something in");
    if (read->path != path || !read->picture) *read = {path, loadPicture(path, {}, progress)};
    const deep::DeepImage& volume = deepOf(*read->picture, "to place");
    const PlacedDepths depths = depthsOf(image, volume);
    const auto placed = [&](const PicturePtr& in) {
      progress.at(0.5);
      if (!in || !in->deep()) return in;
      return makePicture(in->path, deep::insert(in->deep()->copy(), volume.copy(), transform));
    };
    return [this, a, b, placedA = placed(a), placedB = placed(b), depths] {
      if (a != a_ || b != b_) return;
      session_.setA(placedA);
      session_.setB(placedB);
      if (std::exchange(depths_, depths) != depths) emit depthsChanged();
    };
  };
  background_.run(work);
}

}  // namespace fathom::gui
