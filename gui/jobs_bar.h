// The job that runs, in the status bar: its name, how far it is, how long it still takes, and a button that stops it.
#pragma once

#include <QLabel>
#include <QProgressBar>
#include <QToolButton>
#include <QWidget>

#include "gui/jobs.h"

namespace fathom::gui {

class JobsBar : public QWidget {
  Q_OBJECT

 public:
  explicit JobsBar(Jobs& jobs, QWidget* parent = nullptr);

 private:
  void update();

  Jobs& jobs_;
  QLabel* name_;
  QProgressBar* bar_;
  QToolButton* cancel_;
};

}  // namespace fathom::gui
