// What is open and how it is looked at, without widgets. Panels read it, change it, and follow its signals; they know
// nothing of one another.
#pragma once

#include <QObject>
#include <QPoint>
#include <QString>
#include <optional>
#include <utility>

#include "flat/box.h"
#include "gui/overlay.h"
#include "gui/picture.h"
#include "gui/view_state.h"

namespace fathom::gui {

class Session : public QObject {
  Q_OBJECT

 public:
  using QObject::QObject;

  const PicturePtr& a() const { return a_; }  // null before anything is open
  const PicturePtr& b() const { return b_; }  // what A is compared with; null: nothing
  // What the screen shows instead for a moment; all else goes on as if there were none.
  const std::optional<Draft>& draft() const { return draft_; }
  // What is looked at in numbers: B where it alone is shown, else A.
  const PicturePtr& seen() const { return view_.comparison == Comparison::B && b_ ? b_ : a_; }
  const ViewState& view() const { return view_; }
  // In pixels of the image.
  std::optional<QPoint> cursor() const { return cursor_; }
  std::optional<QPoint> pin() const { return pin_; }
  std::optional<Box> box() const { return box_; }
  // The pixel that inspectors show: the pinned one, or else that under the cursor.
  std::optional<QPoint> pixel() const { return pin_ ? pin_ : cursor_; }

  void setA(PicturePtr picture) { setPictures(std::move(picture), b_); }
  void setB(PicturePtr picture) { setPictures(a_, std::move(picture)); }
  // Both at once: nobody sees the one with the other's predecessor. They take the place of a draft.
  void setPictures(PicturePtr a, PicturePtr b);
  void setDraft(Draft draft);
  void setView(const ViewState& view);
  void setCursor(std::optional<QPoint> pixel);
  void setPin(std::optional<QPoint> pixel);
  void setBox(std::optional<Box> box);
  // A line for the status bar.
  void say(const QString& line) { emit said(line); }

 signals:
  // Only on a change.
  void picturesChanged();
  void draftChanged();  // another one; that it is gone is told by the other signal
  void viewChanged();
  void pixelChanged();  // or whether it is pinned
  void boxChanged();
  void said(const QString& line);

 private:
  PicturePtr a_, b_;
  std::optional<Draft> draft_;
  ViewState view_;
  std::optional<QPoint> cursor_, pin_;
  std::optional<Box> box_;
};

}  // namespace fathom::gui
