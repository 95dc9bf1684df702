// The table of a pixel's samples: sorted by a click on a column, columns chosen on the header, rows copied.
#pragma once

#include <QAction>
#include <QTableView>
#include <map>

#include "gui/sample_model.h"

namespace fathom::gui {

class SampleTable : public QTableView {
  Q_OBJECT

 public:
  explicit SampleTable(QWidget* parent = nullptr);

  SampleModel& samples() { return model_; }
  QAction* copyTsvAction() { return &copyTsv_; }
  QAction* copyJsonAction() { return &copyJson_; }
  // The user's choice stays for every picture that has a channel of that name.
  void setColumnShown(const QString& name, bool shown);
  // Scrolls to a sample.
  void reveal(int sample);

 signals:
  void hovered(int sample);  // -1: none
  void failed(const QString& reason);

 protected:
  void leaveEvent(QEvent* event) override;
  void contextMenuEvent(QContextMenuEvent* event) override;

 private:
  void applyColumns();
  void showColumnMenu(const QPoint& at);
  void copy(bool json);
  // The selected samples in the order of the table; all where none is.
  std::vector<int> chosenRows() const;
  std::vector<int> shownColumns() const;

  SampleModel model_;
  SampleOrder order_;
  QAction copyTsv_, copyJson_;
  std::map<QString, bool> chosen_;
};

}  // namespace fathom::gui
