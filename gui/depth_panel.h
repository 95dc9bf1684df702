// Clipping in depth: the histogram of the picture's depths with the planes over it, and what there is to type and switch.
#pragma once

#include <QElapsedTimer>
#include <QTimer>
#include <QWidget>
#include <optional>

#include "deep/depth_histogram.h"
#include "gui/background.h"
#include "gui/clip_model.h"
#include "gui/session.h"

class QAction;
class QComboBox;
class QHBoxLayout;

namespace fathom::gui {

class DepthField;
class HistogramView;

class DepthPanel : public QWidget {
  Q_OBJECT

 public:
  explicit DepthPanel(Session& session, QWidget* parent = nullptr);

  QAction* animateAction() const { return animate_; }
  QAction* logDepthAction() const { return logDepth_; }
  QAction* logCountsAction() const { return logCounts_; }

 signals:
  // A newer histogram is shown.
  void histogramChanged();

 protected:
  void showEvent(QShowEvent* event) override;

 private:
  QAction* addAction(QHBoxLayout* row, const QString& text, const QString& tip, bool checkable);
  DepthField* addField(QHBoxLayout* row, const QString& label, const QString& tip, float none, float least);
  void addRangeControls(QHBoxLayout* row);
  void addHistogramControls(QHBoxLayout* row);

  const deep::DepthRange& range() const { return session_.view().clip; }
  void setRange(const deep::DepthRange& range);
  // The same by hand, which ends an animation.
  void edit(const deep::DepthRange& range);
  void move(ClipHandle handle, int steps);
  void animate(bool on);
  void startSweep();
  void sweep();
  void reset();

  void followPicture();
  void followRange();
  void followPixel();
  void requestHistogram();

  Session& session_;
  ClipModel model_;
  HistogramView* histogram_;
  DepthField *near_, *far_, *soft_;
  QAction *animate_, *invert_, *reset_, *logDepth_, *logCounts_;
  QComboBox* weight_;
  PicturePtr seen_;   // the session's when it was looked at last
  PicturePtr known_;  // that histogram and axis of all depths are of
  bool knownLogarithmic_ = false;
  std::optional<ClipSweep> sweep_;
  deep::DepthRange swept_;  // what the animation set last
  QElapsedTimer time_;
  QTimer ticks_;
  Background background_;
};

}  // namespace fathom::gui
