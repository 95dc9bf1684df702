#include "gui/view_bar.h"

#include <QActionGroup>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QSignalBlocker>
#include <algorithm>
#include <array>

namespace fathom::gui {

namespace {

struct IsolateChoice {
  Isolate isolate;
  const char *label, *text, *key;
};
constexpr std::array kIsolateChoices = {
    IsolateChoice{Isolate::All, "RGB", "All channels", "C"}, IsolateChoice{Isolate::Red, "R", "Red", "R"},
    IsolateChoice{Isolate::Green, "G", "Green", "G"},        IsolateChoice{Isolate::Blue, "B", "Blue", "B"},
    IsolateChoice{Isolate::Alpha, "A", "Alpha", "A"},        IsolateChoice{Isolate::Luminance, "L", "Luminance", "L"},
};

QStringList namesOf(const std::vector<Layer>& layers) {
  QStringList names;
  for (const Layer& layer : layers) names << QString::fromStdString(layer.name);
  return names;
}

}  // namespace

ViewBar::ViewBar(Session& session, QWidget* parent) : QToolBar("View", parent), session_(session) {
  setObjectName("view bar");
  setMovable(false);
  layers_ = new QComboBox;
  layers_->setToolTip("Layer");
  layers_->setSizeAdjustPolicy(QComboBox::AdjustToContents);
  layers_->setMinimumContentsLength(12);
  layers_->setFocusPolicy(Qt::ClickFocus);
  addWidget(layers_);
  connect(layers_, &QComboBox::textActivated, this,
          [this](const QString& name) { change([&](ViewState& view) { view.layer = name.toStdString(); }); });
  addIsolation();
  addSeparator();
  addNumber("Exposure", "Exposure in stops, before the display transform", -20, 20, &DisplayParams::exposure);
  addNumber("Gamma", "Gamma, after the display transform", 0.1, 5, &DisplayParams::gamma);
  addMark("Clipped", "Mark values below 0 and above 1", &DisplayParams::markClipped);
  addMark("NaN", "Mark values that are no number or infinite", &DisplayParams::markNan);
  connect(&session_, &Session::picturesChanged, this, &ViewBar::listLayers);
  connect(&session_, &Session::viewChanged, this, &ViewBar::follow);
  listLayers();
  follow();
}

QList<QAction*> ViewBar::isolateActions() const {
  return isolation_->actions();
}

void ViewBar::changeExposure(double stops) {
  change([&](ViewState& view) { view.display.exposure += float(stops); });
}

void ViewBar::stepLayer(int by) {
  const int count = layers_->count();
  if (count == 0) return;
  const int next = (std::max(0, layers_->currentIndex()) + by + count) % count;
  change([&](ViewState& view) { view.layer = layers_->itemText(next).toStdString(); });
}

void ViewBar::addIsolation() {
  isolation_ = new QActionGroup(this);
  for (const IsolateChoice& choice : kIsolateChoices) {
    QAction* action = isolation_->addAction(choice.text);
    action->setIconText(choice.label);
    action->setCheckable(true);
    action->setShortcut(QKeySequence(choice.key));
    action->setToolTip(QString("%1 (%2)").arg(choice.text, choice.key));
    addAction(action);
    // A second press shows all again.
    connect(action, &QAction::triggered, this, [this, isolate = choice.isolate] {
      change([&](ViewState& view) { view.isolate = view.isolate == isolate ? Isolate::All : isolate; });
    });
    followers_.append(
        [action, isolate = choice.isolate](const ViewState& view) { action->setChecked(view.isolate == isolate); });
  }
}

void ViewBar::addNumber(const QString& label, const QString& tip, double low, double high,
                        float DisplayParams::*member) {
  auto* number = new QDoubleSpinBox;
  number->setRange(low, high);
  number->setSingleStep(0.25);
  number->setDecimals(2);
  number->setToolTip(tip);
  number->setKeyboardTracking(false);
  number->setFocusPolicy(Qt::ClickFocus);
  addWidget(new QLabel(label));
  addWidget(number);
  connect(number, &QDoubleSpinBox::valueChanged, this,
          [this, member](double value) { change([&](ViewState& view) { view.display.*member = float(value); }); });
  followers_.append([number, member](const ViewState& view) {
    const QSignalBlocker quiet(number);
    number->setValue(double(view.display.*member));
  });
}

void ViewBar::addMark(const QString& label, const QString& tip, bool DisplayParams::*member) {
  QAction* action = addAction(label);
  action->setCheckable(true);
  action->setToolTip(tip);
  connect(action, &QAction::toggled, this,
          [this, member](bool on) { change([&](ViewState& view) { view.display.*member = on; }); });
  followers_.append([action, member](const ViewState& view) { action->setChecked(view.display.*member); });
}

void ViewBar::listLayers() {
  const QSignalBlocker quiet(layers_);
  layers_->clear();
  if (session_.a()) layers_->addItems(namesOf(session_.a()->layers));
  layers_->setEnabled(layers_->count() > 0);
  follow();
}

void ViewBar::follow() {
  const QSignalBlocker quiet(layers_);
  layers_->setCurrentText(QString::fromStdString(session_.view().layer));
  for (const auto& follower : followers_) follower(session_.view());
}

template <class Change>
void ViewBar::change(const Change& change) {
  ViewState view = session_.view();
  change(view);
  session_.setView(view);
  follow();
}

}  // namespace fathom::gui
