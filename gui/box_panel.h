// The box that was dragged in the picture, in numbers: computed in the background.
#pragma once

#include <QLabel>
#include <QTableWidget>

#include "deep/box_statistics.h"
#include "gui/background.h"
#include "gui/session.h"

namespace fathom::gui {

class BoxPanel : public QWidget {
  Q_OBJECT

 public:
  explicit BoxPanel(Session& session, QWidget* parent = nullptr);

 signals:
  void ready();  // what is shown is new

 protected:
  void showEvent(QShowEvent* event) override;

 private:
  void follow();
  void say(const QString& text);
  void show(const deep::BoxStatistics& statistics, float stops);
  void showBins(const deep::BoxStatistics& statistics);
  void showCounts(const deep::Statistics& counts);

  Session& session_;
  PicturePtr asked_;  // of what the numbers are
  std::optional<Box> box_;
  std::string layer_;
  QLabel* summary_;
  QTableWidget *counts_, *bins_;
  Background job_;
};

}  // namespace fathom::gui
