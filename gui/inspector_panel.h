// The bin inspector: the samples of the pixel under the cursor, or of the pinned one, as a plot and a table, the row
// around it from above, and the box in numbers.
#pragma once

#include <QAction>
#include <QLabel>
#include <QTabWidget>
#include <QTimer>
#include <QToolButton>
#include <optional>
#include <string>

#include "gui/box_panel.h"
#include "gui/depth_plot.h"
#include "gui/depth_slice.h"
#include "gui/sample_table.h"

namespace fathom::gui {

class InspectorPanel : public QWidget {
  Q_OBJECT

 public:
  explicit InspectorPanel(Session& session, QWidget* parent = nullptr);

  // For menus; all have texts, the copying ones their keys while the table has the focus.
  QAction* copyTsvAction() { return table_->copyTsvAction(); }
  QAction* copyJsonAction() { return table_->copyJsonAction(); }
  QAction* unpinAction() { return &unpin_; }
  QAction* logarithmicAction() { return &logarithmic_; }  // checkable: depths by their logarithm

  enum class Tab { Samples, Slice, Box };
  void showTab(Tab tab) { tabs_->setCurrentIndex(int(tab)); }

 private:
  // All that the samples and their colours depend on.
  struct Request {
    PicturePtr picture;
    std::optional<QPoint> pixel;
    std::string layer;
    float stops = 0;
    bool operator==(const Request&) const = default;
  };
  static PixelSamples answer(const Request& request);
  void follow();
  void followView();
  void showSamples(PixelSamples samples);
  void highlight(int sample);
  void describe();

  Session& session_;
  QAction unpin_, logarithmic_;
  QTimer soon_;  // a cursor moves more often than a screen is drawn
  QLabel *place_, *state_;
  QToolButton* unpinButton_;
  QTabWidget* tabs_;
  DepthPlot* plot_;
  SampleTable* table_;
  DepthSlice* slice_;
  BoxPanel* box_;
  Request shown_;      // or asked for
  Background reader_;  // of pixels with many samples
};

}  // namespace fathom::gui
