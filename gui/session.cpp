#include "gui/session.h"

namespace fathom::gui {

namespace {

// Takes the value over, and tells whether it is a new one.
template <class T>
bool assign(T& to, T value) {
  if (to == value) return false;
  to = std::move(value);
  return true;
}

}  // namespace

void Session::setPictures(PicturePtr a, PicturePtr b) {
  const bool isNewA = assign(a_, std::move(a)), isNewB = assign(b_, std::move(b));
  const bool hadDraft = std::exchange(draft_, std::nullopt).has_value();
  if (isNewA || isNewB || hadDraft) emit picturesChanged();
}

void Session::setDraft(Draft draft) {
  draft_ = std::move(draft);
  emit draftChanged();
}

void Session::setView(const ViewState& view) {
  if (assign(view_, view)) emit viewChanged();
}

void Session::setCursor(std::optional<QPoint> pixel) {
  const std::optional<QPoint> before = this->pixel();
  cursor_ = pixel;
  if (before != this->pixel()) emit pixelChanged();
}

void Session::setPin(std::optional<QPoint> pixel) {
  if (assign(pin_, pixel)) emit pixelChanged();
}

void Session::setBox(std::optional<Box> box) {
  if (assign(box_, box)) emit boxChanged();
}

}  // namespace fathom::gui
