#include "gui/placement.h"

#include <algorithm>
#include <cstdlib>

#include "base/error.h"
#include "deep/ops/insert.h"
#include "deep/statistics.h"

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

constexpr int kRest = 150;  // ms without a move

// The volume with some of its channels, and those that it takes to place it.
deep::DeepImage copyWith(const deep::DeepImage& image, const std::vector<std::string>& channels) {
  deep::DeepImage result = image.copyLayout();
  for (const deep::Channel& channel : image.channels) {
    const bool placing = channel.name == "A" || channel.name == "Z" || channel.name == "ZBack";
    if (!placing && std::ranges::find(channels, channel.name) == channels.end()) continue;
    deep::Channel& copy = result.add(channel.name, channel.type);
    std::ranges::copy(channel.values, copy.values.begin());
    std::ranges::copy(channel.ids, copy.ids.begin());
  }
  return result;
}

// Where its pixels move by whole numbers, the volume is moved as it is looked at; else it is made anew for every place,
// with the layer's channels.
OverlayPtr overlayOf(const PicturePtr& volume, const deep::Transform& transform, const Layer& layer) {
  if (transform.movesWholePixels()) return std::make_shared<Overlay>(Overlay{{volume, volume->deep()}, transform});
  deep::DeepImage moved = deep::transform(copyWith(*volume->deep(), layer.channels), transform);
  return std::make_shared<Overlay>(Overlay{std::make_shared<const deep::DeepImage>(std::move(moved)), {}});
}

PicturePtr placedIn(const PicturePtr& in, const deep::DeepImage& volume, const deep::Transform& transform,
                    const std::stop_token& stop) {
  if (!in || !in->deep()) return in;
  return makePicture(in->path, deep::insert(*in->deep(), volume.copy(), transform, stop));
}

deep::DeepImage withoutRows(const deep::DeepImage& image) {
  return deep::rows(image, image.dataWindow.y0, image.dataWindow.y0);
}

// The layer of that name, where it is the same with and without the volume: a volume may bring layers, and take some away.
const Layer* commonLayer(const PicturePtr& in, const deep::DeepImage& volume, const deep::Transform& transform,
                         const std::string& name) {
  if (!in->deep()) return in->layer(name);
  const PicturePtr form = makePicture(in->path, deep::insert(withoutRows(*in->deep()), withoutRows(volume), transform));
  const Layer *before = in->layer(name), *after = form->layer(name);
  return before && after && before->channels == after->channels && before->kind == after->kind ? before : nullptr;
}

int nearestOf(const std::vector<int>& frames, int frame) {
  return *std::ranges::min_element(frames, {}, [&](int other) { return std::abs(int64_t(other) - frame); });
}

}  // namespace

Placement::Placement(Session& session, Frames& frames, QObject* parent)
    : QObject(parent), session_(session), frames_(frames), read_(std::make_shared<Read>()) {
  // The picture without the volume is better than that of another frame.
  connect(&background_, &Background::failed, this, [this](const QString& line) {
    whole_ = false;
    session_.say(line);
    session_.setPictures(a_, b_);
  });
  rest_.setSingleShot(true);
  rest_.setInterval(kRest);
  connect(&rest_, &QTimer::timeout, this, [this] {
    if (!background_.busy()) place();  // else another draft is made, after which there is another rest
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
    background_.clear();
    rest_.stop();
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
  rest_.stop();
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
  if (volume_ && a_) draft();
  emit changed();
}

const deep::DeepImage& Placement::volumeOf(Read& read, const std::string& path, const PicturePtr& a, size_t memory,
                                           const Progress& progress) {
  const deep::DeepImage& image = deepOf(*a, "to place something in");
  if (read.path != path || !read.picture) read = {path, loadPicture(path, memory, progress), {}, {}};
  const deep::DeepImage& volume = deepOf(*read.picture, "to place");
  if (std::exchange(read.a, a) != a) read.depths = depthsOf(image, volume);
  return volume;
}

void Placement::delivered(const PlacedDepths& depths) {
  if (std::exchange(depths_, depths) != depths) emit depthsChanged();
}

void Placement::draft() {
  if (std::exchange(whole_, false)) background_.clear();
  const auto work = [this, a = a_, b = b_, path = file(), transform = transform_, name = session_.view().layer,
                     memory = frames_.cache().limit(), read = read_](const Progress& progress) -> Background::Deliver {
    const deep::DeepImage& volume = volumeOf(*read, path, a, memory, progress);
    const Layer* layer = commonLayer(a, volume, transform, name);
    if (!layer || (b && !commonLayer(b, volume, transform, name))) return [this] { rest_.start(); };
    return [this, a, b, name, overlay = overlayOf(read->picture, transform, *layer), depths = read->depths] {
      if (a == a_ && b == b_) session_.setDraft({a, b, overlay, name});
      delivered(depths);
      rest_.start();
    };
  };
  rest_.stop();
  background_.run(work);
}

void Placement::place() {
  if (!a_) return session_.setPictures(a_, b_);
  const auto work = [this, a = a_, b = b_, path = file(), transform = transform_, memory = frames_.cache().limit(),
                     read = read_](const Progress& progress) -> Background::Deliver {
    const deep::DeepImage& volume = volumeOf(*read, path, a, memory, progress);
    const PicturePtr placedA = placedIn(a, volume, transform, progress.stop);
    const PicturePtr placedB = placedIn(b, volume, transform, progress.stop);
    return [this, a, b, placedA, placedB, depths = read->depths] {
      whole_ = false;
      if (a == a_ && b == b_) session_.setPictures(placedA, placedB);
      delivered(depths);
    };
  };
  whole_ = true;
  background_.run(work);
}

}  // namespace fathom::gui
