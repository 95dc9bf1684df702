#include "gui/view_bar.h"

#include <QActionGroup>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QSignalBlocker>
#include <algorithm>
#include <array>

#include "gui/false_colours.h"

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

bool showsFalseColours(const PicturePtr& picture, const ViewState& view) {
  const Layer* layer = picture ? picture->layer(view.layer) : nullptr;
  return layer && hasFalseColours(layer->kind);
}

QStringList namesOf(const std::vector<Layer>& layers) {
  QStringList names;
  for (const Layer& layer : layers) names << QString::fromStdString(layer.name);
  return names;
}

std::vector<std::string> namesIn(const QComboBox& choice) {
  std::vector<std::string> names;
  for (int i = 0; i < choice.count(); ++i) names.push_back(choice.itemData(i).toString().toStdString());
  return names;
}

// Without zeros at the end.
class NumberBox : public QDoubleSpinBox {
 public:
  QString textFromValue(double value) const override {
    QString text = QDoubleSpinBox::textFromValue(value);
    if (!text.contains(locale().decimalPoint())) return text;
    while (text.endsWith(locale().zeroDigit())) text.chop(1);
    if (text.endsWith(locale().decimalPoint())) text.chop(locale().decimalPoint().size());
    return text;
  }
};

}  // namespace

ViewBar::ViewBar(Session& session, std::shared_ptr<const Display> display, QWidget* parent)
    : QToolBar("View", parent), session_(session), display_(std::move(display)) {
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
  addNumber("Exposure", "Exposure in stops, before the display transform", -20, 20, 2, &DisplayParams::exposure);
  addNumber("Gamma", "Gamma, after the display transform", 0.1, 5, 2, &DisplayParams::gamma);
  const QList<QAction*> low = addNumber("From", "Where the false colours begin; as high as To: where the values do",
                                        -1e9, 1e9, 6, &DisplayParams::low);
  const QList<QAction*> high = addNumber("To", "Where the false colours end", -1e9, 1e9, 6, &DisplayParams::high);
  followers_.append([this, ends = low + high](const ViewState& view) {
    for (QAction* action : ends) action->setVisible(showsFalseColours(session_.a(), view));
  });
  addChoice("Display", &DisplayParams::display, [this] { return display_->displays(); });
  addChoice("View of that display", &DisplayParams::view,
            [this] { return display_->views(session_.view().display.display); });
  addChoice("Look", &DisplayParams::look, [this] {
    std::vector<std::string> looks = display_->looks();
    looks.insert(looks.begin(), std::string());
    return looks;
  });
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

QList<QAction*> ViewBar::addNumber(const QString& label, const QString& tip, double low, double high, int decimals,
                                   float DisplayParams::*member) {
  auto* number = new NumberBox;
  number->setRange(low, high);
  number->setSingleStep(0.25);
  number->setDecimals(decimals);
  number->setToolTip(tip);
  number->setKeyboardTracking(false);
  number->setFocusPolicy(Qt::ClickFocus);
  const QList<QAction*> actions = {addWidget(new QLabel(label)), addWidget(number)};
  connect(number, &QDoubleSpinBox::valueChanged, this,
          [this, member](double value) { change([&](ViewState& view) { view.display.*member = float(value); }); });
  connect(number, &QAbstractSpinBox::editingFinished, number, &QWidget::clearFocus);  // keys belong to the picture
  followers_.append([number, member](const ViewState& view) {
    const QSignalBlocker quiet(number);
    number->setValue(double(view.display.*member));
  });
  return actions;
}

void ViewBar::addChoice(const QString& tip, std::string DisplayParams::*member,
                        const std::function<std::vector<std::string>()>& names) {
  auto* choice = new QComboBox;
  choice->setToolTip(tip);
  choice->setSizeAdjustPolicy(QComboBox::AdjustToContents);
  choice->setFocusPolicy(Qt::ClickFocus);
  QAction* action = addWidget(choice);
  connect(choice, &QComboBox::activated, this, [=, this](int index) {
    change([&](ViewState& view) { view.display.*member = choice->itemData(index).toString().toStdString(); });
  });
  followers_.append([=](const ViewState& view) {
    const QSignalBlocker quiet(choice);
    const std::vector<std::string> wanted = names();
    if (wanted != namesIn(*choice)) {
      choice->clear();
      for (const std::string& name : wanted) {
        const QString text = QString::fromStdString(name);
        choice->addItem(name.empty() ? "No look" : text, text);
      }
    }
    choice->setCurrentIndex(std::max(0, choice->findData(QString::fromStdString(view.display.*member))));
    action->setVisible(choice->count() > 1);
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
