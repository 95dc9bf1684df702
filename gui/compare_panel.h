// A and B: which are open, how the two are shown together, and how far A is from B in numbers.
#pragma once

#include <QActionGroup>
#include <QLabel>
#include <QTableWidget>
#include <QTimer>
#include <QWidget>

#include "gui/background.h"
#include "gui/compare_numbers.h"
#include "gui/frames.h"

namespace fathom::gui {

class ComparePanel : public QWidget {
  Q_OBJECT

 public:
  ComparePanel(Session& session, Frames& frames, QWidget* parent = nullptr);

  // A, B, wipe, side by side, difference, relative error; for a menu. They have no keys.
  QList<QAction*> modeActions() const { return modes_->actions(); }

  // A where it is not on the screen, or else B.
  void toggle();
  // Asks for a file.
  void openB();

 signals:
  // Numbers came, or went.
  void measured();

 protected:
  void showEvent(QShowEvent* event) override;

 private:
  void makeModes();
  void makeTable();
  void followPictures();
  void followView();
  void setMode(Comparison mode);
  void measure();
  void showNumbers(const ComparedNumbers& numbers);
  void clearNumbers(const QString& why);

  Session& session_;
  Frames& frames_;
  QActionGroup* modes_;
  QLabel *nameA_, *nameB_, *notes_;
  QWidget *swap_, *close_;
  QTableWidget* table_;
  QTimer settle_;  // numbers are made when nothing has changed for a moment
  Background background_;
  // What the numbers on show are of.
  std::weak_ptr<const Picture> measuredA_, measuredB_;
  std::vector<float> measuredClips_;
};

}  // namespace fathom::gui
