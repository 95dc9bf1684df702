// The box that was dragged in the picture, in numbers: computed in the background.
#pragma once

#include <QLabel>
#include <QTableWidget>

#include <optional>
#include <string>

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
  void hideEvent(QHideEvent* event) override;

 private:
  // All that the numbers depend on.
  struct Request {
    PicturePtr picture;
    Box box;
    std::string layer;
    bool operator==(const Request&) const = default;
  };
  void follow();
  void forget(const QString& why);
  void say(const QString& text);
  void show(const deep::BoxStatistics& statistics);
  void describe();
  void showBins();
  void showCounts();

  Session& session_;
  std::optional<Request> requested_;
  std::optional<deep::BoxStatistics> shown_;
  QLabel* summary_;
  QTableWidget *counts_, *bins_;
  Background job_;
};

}  // namespace fathom::gui
