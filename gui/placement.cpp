#include "gui/placement.h"

#include <algorithm>
#include <cstdlib>

#include "deep/ops/insert.h"
#include "deep/statistics.h"
#include "flat/error.h"
#include "gui/pixel_samples.h"

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

// A frame has many channels, of which a few are seen.
constexpr size_t kFewChannels = 12;

bool isWorthADraft(const Picture& picture) {
  return picture.deep() && picture.deep()->channels.size() > kFewChannels;
}

// The image with some of its channels, and those that it takes to place something.
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

// The picture with the volume; a draft has no channels but those of the layer and of the colours beside it, and says that
// it has all.
PicturePtr placedIn(const PicturePtr& in, const deep::DeepImage& volume, const deep::Transform& transform,
                    const std::string* draftLayer) {
  if (!in || !in->deep()) return in;
  const Layer* layer = draftLayer ? in->layer(*draftLayer) : nullptr;
  if (!layer) return makePicture(in->path, deep::insert(in->deep()->copy(), volume.copy(), transform));
  std::vector<std::string> channels = colourChannels(*in, layer->name);
  channels.insert(channels.end(), layer->channels.begin(), layer->channels.end());
  deep::DeepImage seen = deep::insert(copyWith(*in->deep(), channels), copyWith(volume, channels), transform);
  return std::make_shared<Picture>(Picture{in->path, std::move(seen), in->layers});
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
    session_.setPictures(a_, b_);
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
  if (volume_ && a_) place(isWorthADraft(*a_));
  emit changed();
}

void Placement::place(bool draft) {
  if (!a_) return session_.setPictures(a_, b_);
  const auto work = [this, draft, a = a_, b = b_, path = file(), transform = transform_, layer = session_.view().layer,
                     memory = frames_.cache().limit(), read = read_](const Progress& progress) -> Background::Deliver {
    const deep::DeepImage& image = deepOf(*a, "to place something in");
    if (read->path != path || !read->picture) *read = {path, loadPicture(path, memory, progress), {}, {}};
    const deep::DeepImage& volume = deepOf(*read->picture, "to place");
    if (std::exchange(read->a, a) != a) read->depths = depthsOf(image, volume);
    progress.at(0.3);
    const PicturePtr placedA = placedIn(a, volume, transform, draft ? &layer : nullptr);
    progress.at(0.6);
    const PicturePtr placedB = placedIn(b, volume, transform, draft ? &layer : nullptr);
    return [this, draft, a, b, placedA, placedB, depths = read->depths] {
      if (a != a_ || b != b_) return;
      session_.setPictures(placedA, placedB);
      if (std::exchange(depths_, depths) != depths) emit depthsChanged();
      if (draft && !background_.busy()) place();
    };
  };
  background_.run(work);
}

}  // namespace fathom::gui
