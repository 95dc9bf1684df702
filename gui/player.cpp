#include "gui/player.h"

#include <algorithm>
#include <cmath>

namespace fathom::gui {

Player::Player(QObject* parent) : QObject(parent) {
  timer_.setTimerType(Qt::PreciseTimer);
  connect(&timer_, &QTimer::timeout, this, &Player::tick);
  setFps(fps_);
}

int Player::nearest(int frame) const {
  const auto above = std::ranges::lower_bound(frames_, frame);
  if (above == frames_.end()) return frames_.back();
  if (above == frames_.begin()) return frames_.front();
  const int below = *(above - 1);
  return int64_t(*above) - frame <= int64_t(frame) - below ? *above : below;
}

void Player::setFrames(std::vector<int> frames, int frame) {
  stop();
  const int before = frame_;
  frames_ = frames.empty() ? std::vector<int>{0} : std::move(frames);
  in_ = frames_.front();
  out_ = frames_.back();
  frame_ = nearest(frame);
  direction_ = 1;
  emit framesChanged();
  emit rangeChanged();
  if (frame_ != before) emit frameChanged(frame_);
}

Player::Step Player::stepFrom(int frame, int direction) const {
  const auto begin = std::ranges::lower_bound(frames_, in_), end = std::ranges::upper_bound(frames_, out_);
  const int first = *begin, last = *(end - 1);
  if (first == last) return {first, frame == first ? 0 : direction};
  // From outside of what is played, the step is to its nearer end.
  if (frame < first) return {first, direction};
  if (frame > last) return {last, direction};
  const auto here = std::ranges::lower_bound(frames_, frame);
  if (direction > 0 ? frame < last : frame > first) return {*(direction > 0 ? here + 1 : here - 1), direction};
  if (repeat_ == Repeat::Once) return {frame, 0};
  if (repeat_ == Repeat::Loop) return {direction > 0 ? first : last, direction};
  return {*(direction > 0 ? here - 1 : here + 1), -direction};
}

std::vector<int> Player::ahead(size_t count) const {
  std::vector<int> result;
  Step at{frame_, direction_};
  // A way there and back passes each frame twice at most.
  for (size_t tries = 2 * frames_.size(); tries > 0 && result.size() < count; --tries) {
    at = stepFrom(at.frame, at.direction);
    if (at.direction == 0) break;
    if (at.frame != frame_ && std::ranges::find(result, at.frame) == result.end()) result.push_back(at.frame);
  }
  return result;
}

void Player::tick() {
  const Step step = stepFrom(frame_, direction_);
  if (step.direction == 0) return stop();
  if (ready_ && !ready_(step.frame)) return;
  direction_ = step.direction;
  setFrame(step.frame);
}

void Player::setFrame(int frame) {
  frame = nearest(frame);
  if (frame == frame_) return;
  if (!playing()) direction_ = frame < frame_ ? -1 : 1;
  frame_ = frame;
  emit frameChanged(frame_);
}

void Player::step(int direction) {
  stop();
  direction_ = direction;
  const int played[] = {*std::ranges::lower_bound(frames_, in_), *(std::ranges::upper_bound(frames_, out_) - 1)};
  const int end = played[direction > 0 ? 1 : 0];
  const int to = frame_ == end ? played[direction > 0 ? 0 : 1] : stepFrom(frame_, direction).frame;
  setFrame(to);
  direction_ = direction;
}

void Player::next() {
  step(1);
}

void Player::previous() {
  step(-1);
}

void Player::first() {
  stop();
  setFrame(*std::ranges::lower_bound(frames_, in_));
  direction_ = 1;
}

void Player::last() {
  stop();
  setFrame(*(std::ranges::upper_bound(frames_, out_) - 1));
  direction_ = -1;
}

void Player::play(int direction) {
  direction = direction < 0 ? -1 : 1;
  // Played once to its end, it begins again.
  if (repeat_ == Repeat::Once && stepFrom(frame_, direction).direction == 0) setFrame(direction > 0 ? in_ : out_);
  direction_ = direction;
  if (playing() || stepFrom(frame_, direction_).direction == 0) return;
  timer_.start();
  emit playingChanged(true);
}

void Player::stop() {
  if (!playing()) return;
  timer_.stop();
  emit playingChanged(false);
}

void Player::toggle() {
  playing() ? stop() : play(direction_);
}

void Player::setIn(int frame) {
  frame = nearest(frame);
  if (frame == in_) return;
  in_ = frame;
  out_ = std::max(in_, out_);
  emit rangeChanged();
}

void Player::setOut(int frame) {
  frame = nearest(frame);
  if (frame == out_) return;
  out_ = frame;
  in_ = std::min(in_, out_);
  emit rangeChanged();
}

void Player::clearRange() {
  setIn(frames_.front());
  setOut(frames_.back());
}

void Player::setFps(double fps) {
  fps = std::clamp(fps, 1.0, 240.0);
  timer_.setInterval(int(std::lround(1000 / fps)));
  if (fps == fps_) return;
  fps_ = fps;
  emit settingsChanged();
}

void Player::setRepeat(Repeat repeat) {
  if (repeat == repeat_) return;
  repeat_ = repeat;
  emit settingsChanged();
}

}  // namespace fathom::gui
