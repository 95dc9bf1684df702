// The bar above the picture: which layer, which of its channels, and how bright.
#pragma once

#include <QToolBar>
#include <functional>

#include "gui/session.h"

class QActionGroup;
class QComboBox;

namespace fathom::gui {

class ViewBar : public QToolBar {
  Q_OBJECT

 public:
  explicit ViewBar(Session& session, QWidget* parent = nullptr);

  // All channels, R, G, B, A, luminance: to be shown in a menu, too.
  QList<QAction*> isolateActions() const;

 public slots:
  void nextLayer() { stepLayer(1); }
  void previousLayer() { stepLayer(-1); }
  void changeExposure(double stops);

 private:
  void stepLayer(int by);
  void addIsolation();
  void addNumber(const QString& label, const QString& tip, double low, double high, float DisplayParams::*member);
  void addMark(const QString& label, const QString& tip, bool DisplayParams::*member);
  void listLayers();
  void follow();
  template <class Change>
  void change(const Change& change);

  Session& session_;
  QComboBox* layers_;
  QActionGroup* isolation_;
  // Bring what they show in line with the view.
  QList<std::function<void(const ViewState&)>> followers_;
};

}  // namespace fathom::gui
