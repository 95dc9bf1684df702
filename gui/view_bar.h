// The bar above the picture: which layer, which of its channels, how bright, and through which display transform.
#pragma once

#include <QToolBar>
#include <functional>
#include <memory>

#include "gui/display.h"
#include "gui/session.h"

class QActionGroup;
class QComboBox;

namespace fathom::gui {

class ViewBar : public QToolBar {
  Q_OBJECT

 public:
  ViewBar(Session& session, std::shared_ptr<const Display> display, QWidget* parent = nullptr);

  // All channels, R, G, B, A, luminance: to be shown in a menu, too.
  QList<QAction*> isolateActions() const;

  void nextLayer() { stepLayer(1); }
  void previousLayer() { stepLayer(-1); }
  void changeExposure(double stops);

 private:
  void stepLayer(int by);
  void addIsolation();
  // Returns what can be hidden.
  QList<QAction*> addNumber(const QString& label, const QString& tip, double low, double high, int decimals,
                            float DisplayParams::*member);
  // One of `names()`, the first of which is the default; hidden where there is no choice.
  void addChoice(const QString& tip, std::string DisplayParams::*member,
                 const std::function<std::vector<std::string>()>& names);
  void addMark(const QString& label, const QString& tip, bool DisplayParams::*member);
  void listLayers();
  void follow();
  template <class Change>
  void change(const Change& change);

  Session& session_;
  std::shared_ptr<const Display> display_;
  QComboBox* layers_;
  QActionGroup* isolation_;
  // Bring what they show in line with the view.
  QList<std::function<void(const ViewState&)>> followers_;
};

}  // namespace fathom::gui
