#include "gui/frames.h"

#include <algorithm>
#include <filesystem>
#include <unordered_set>
#include <utility>

#include "base/error.h"

namespace fathom::gui {

namespace {

constexpr size_t kMostAhead = 256;  // frames

}  // namespace

std::string Source::at(int frame) const {
  const std::string file = pattern.at(frame);
  return made.isEmpty() ? file : file + " (" + made.toStdString() + ")";
}

Found findSource(const QString& path, bool asSequence) {
  const std::string name = path.toStdString();
  if (std::error_code none; std::filesystem::exists(name, none)) {
    const std::optional<cli::NumberedFile> number = asSequence ? cli::findNumber(name) : std::nullopt;
    if (number && number->pattern.at(number->frame) == name)
      if (std::vector<int> frames = cli::framesOnDisk(number->pattern); frames.size() > 1)
        return {{number->pattern, std::move(frames), {}}, number->frame};
    return {{{name, "", 0}, {0}, {}}, 0};
  }
  cli::Sequence sequence = cli::findSequence(name);
  const int first = sequence.frames.front();
  return {{std::move(sequence.pattern), std::move(sequence.frames), {}}, first};
}

QStringList distinctSources(const QStringList& paths) {
  QStringList result;
  std::unordered_set<std::string> taken;
  for (const QString& path : paths) {
    if (!taken.insert(path.toStdString()).second) continue;
    result << path;
    try {
      const Source source = findSource(path).source;
      for (const int frame : source.frames) taken.insert(source.at(frame));
    } catch (const Error&) {  // said when it is opened
    }
  }
  return result;
}

Frames::Frames(Session& session, QObject* parent, FrameCache::Load load)
    : QObject(parent), session_(session), cache_(nullptr, std::move(load)) {
  player_.setReady([this](int frame) { return ready(frame) && !(stageBusy_ && stageBusy_()); });
  const auto follow = [this] {
    want();
    show();
  };
  connect(&player_, &Player::frameChanged, this, follow);
  connect(&player_, &Player::rangeChanged, this, &Frames::want);
  connect(&player_, &Player::settingsChanged, this, &Frames::want);
  connect(&player_, &Player::playingChanged, this, &Frames::want);
  connect(&cache_, &FrameCache::loaded, this, &Frames::show);
  connect(&cache_, &FrameCache::failed, this, &Frames::readFailed);
}

bool Frames::ready(int frame) const {
  const auto settled = [&](const std::optional<Source>& of) {
    return !of || !of->made.isEmpty() || cache_.settled(of->at(frame));
  };
  return settled(a_) && settled(b_);
}

bool Frames::cached(int frame) const {
  return a_ && cache_.find(a_->at(frame)) && (!b_ || !b_->made.isEmpty() || cache_.find(b_->at(frame)));
}

void Frames::setStage(Show show, std::function<bool()> busy) {
  stage_ = std::move(show);
  stageBusy_ = std::move(busy);
  if (originalA_) pass();
}

void Frames::pass() {
  if (stage_) return stage_(originalA_, originalB_);
  session_.setPictures(originalA_, originalB_);
}

// The frames of A are played, or else those of B.
void Frames::setFrames(int frame) {
  const std::optional<Source>& leading = b_ && b_->isSequence() && !(a_ && a_->isSequence()) ? b_ : a_;
  if (!leading) return;
  if (leading->frames != player_.frames())
    player_.setFrames(leading->frames, frame);
  else
    player_.setFrame(frame);
}

void Frames::want() {
  const auto isMade = [](const std::optional<Source>& source) { return source && !source->made.isEmpty(); };
  if (!isMade(a_) && !isMade(b_) && !before_) cache_.forgetMade();
  std::vector<std::string> paths;
  std::unordered_set<std::string> asked;
  const auto add = [&](int frame) {
    for (const std::optional<Source>* source : {&a_, &b_}) {
      if (!*source) continue;
      std::string path = (*source)->at(frame);
      // What was made cannot be read again.
      if (!(*source)->made.isEmpty() && !cache_.find(path)) continue;
      if (asked.insert(path).second) paths.push_back(std::move(path));
    }
  };
  add(player_.frame());
  const size_t shown = paths.size();
  for (const int frame : player_.ahead(kMostAhead)) add(frame);
  cache_.want(std::move(paths), shown);
}

// Both together, so that frames that do not belong together are never compared: where A cannot be read, B stays, too.
void Frames::show() {
  const int frame = player_.frame();
  if (!ready(frame)) return;
  const PicturePtr a = a_ ? cache_.find(a_->at(frame)) : nullptr;
  PicturePtr b = b_ ? cache_.find(b_->at(frame)) : nullptr;
  if (a && std::exchange(before_, {})) {
    want();
    emit opened();
  }
  if (!a && a_ && b_) b = originalB_;
  if (!a && a_ && !a_->made.isEmpty()) session_.say(tr("no %1").arg(QString::fromStdString(a_->at(frame))));
  const bool changed = (a && a != originalA_) || b != originalB_;
  if (a) originalA_ = a;
  originalB_ = b;
  if (changed) pass();
}

void Frames::readFailed(const std::string& path, const QString& reason) {
  session_.say(reason);
  const int frame = player_.frame();
  if (before_ && a_ && !a_->isSequence() && a_->at(frame) == path) {
    const Before before = *std::exchange(before_, {});
    a_ = before.a;
    if (!b_) b_ = before.madeB;
    player_.setFrames(before.frames, before.frame);
    emit sourcesChanged();
    want();
  } else if (b_ && !b_->isSequence() && b_->at(frame) == path && !cache_.find(path)) {
    closeB();
  }
  show();
}

void Frames::setResult(const std::string& file, const QString& made, PicturePtr picture) {
  if (!a_ || !a_->made.isEmpty() || std::ranges::none_of(a_->frames, [&](int f) { return a_->at(f) == file; })) return;
  Source source = *a_;
  source.made = made;
  cache_.put(file + " (" + made.toStdString() + ")", std::move(picture));
  b_ = std::move(source);
  sourcesAreNew();
}

void Frames::sourcesAreNew() {
  emit sourcesChanged();
  want();
  show();
}

void Frames::open(const QString& path) {
  try {
    Found found = findSource(path);
    if (!before_) before_ = Before{a_, {}, player_.frames(), player_.frame()};
    a_ = std::move(found.source);
    if (b_ && !b_->made.isEmpty()) before_->madeB = std::exchange(b_, {});
    setFrames(found.frame);
  } catch (const std::exception& e) {
    return session_.say(QString::fromStdString(e.what()));
  }
  cache_.forgetFailures();
  sourcesAreNew();
}

void Frames::openB(const QString& path) {
  if (!a_) return open(path);
  try {
    b_ = findSource(path, a_ && a_->isSequence()).source;
    setFrames(player_.frame());
  } catch (const std::exception& e) {
    return session_.say(QString::fromStdString(e.what()));
  }
  cache_.forgetFailures();
  sourcesAreNew();
}

void Frames::closeB() {
  if (!b_) return;
  b_.reset();
  setFrames(player_.frame());
  sourcesAreNew();
}

void Frames::swap() {
  if (!a_ || !b_) return;
  std::swap(a_, b_);
  setFrames(player_.frame());
  sourcesAreNew();
}

void Frames::reload() {
  try {
    for (std::optional<Source>* source : {&a_, &b_})
      if (*source && (*source)->isSequence()) (*source)->frames = cli::findSequence((*source)->pattern.text()).frames;
  } catch (const Error& e) {
    return session_.say(QString::fromStdString(e.what()));
  }
  setFrames(player_.frame());
  cache_.reload();
  want();
  show();
}

}  // namespace fathom::gui
