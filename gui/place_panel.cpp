#include "gui/place_panel.h"

#include <QFileDialog>
#include <QFileInfo>
#include <QGridLayout>
#include <QPushButton>
#include <QSignalBlocker>
#include <algorithm>
#include <cmath>

namespace fathom::gui {

namespace {

constexpr int kSteps = 1000;       // of a slider, to each side
constexpr double kMostScale = 10;  // that a slider reaches; more can be typed
constexpr double kAnyNumber = 1e6;

// Fine near the middle, far at the ends.
double cube(double t) {
  return t * t * t;
}

QString rangeText(float nearest, float farthest) {
  return QStringLiteral("%1 … %2").arg(double(nearest), 0, 'g', 4).arg(double(farthest), 0, 'g', 4);
}

}  // namespace

PlacePanel::PlacePanel(Session& session, Placement& placement, QWidget* parent)
    : QWidget(parent),
      session_(session),
      placement_(placement),
      name_(new QLabel),
      depths_(new QLabel),
      controls_(new QWidget),
      remove_(nullptr) {
  auto* open = new QPushButton(tr("Open…"));
  open->setToolTip(tr("Open a volume, or any deep image, and place it in A"));
  auto* remove = new QPushButton(tr("Remove"));
  remove->setObjectName("removeVolume");
  remove_ = remove;
  name_->setTextFormat(Qt::PlainText);
  name_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  depths_->setTextFormat(Qt::PlainText);
  depths_->setWordWrap(true);
  auto* top = new QHBoxLayout;
  top->addWidget(name_, 1);
  top->addWidget(open);
  top->addWidget(remove);
  auto* grid = new QGridLayout(controls_);
  grid->setContentsMargins(0, 0, 0, 0);
  grid->setColumnStretch(1, 1);
  addControl("depth", tr("Depth"), tr("How much farther it stands"), &deep::Transform::z);
  addControl("depthScale", tr("Depth scale"), tr("Depths are multiplied by this before they are moved"),
             &deep::Transform::zScale);
  addControl("x", tr("Right"), tr("Pixels to the right"), &deep::Transform::x);
  addControl("y", tr("Down"), tr("Pixels down"), &deep::Transform::y);
  addControl("size", tr("Size"), tr("Scale in the picture, about its middle"), &deep::Transform::scale);
  auto* reset = new QPushButton(tr("As rendered"));
  reset->setObjectName("asRendered");
  reset->setToolTip(tr("Back to where the volume was rendered"));
  grid->addWidget(reset, grid->rowCount(), 2);
  auto* layout = new QVBoxLayout(this);
  layout->addLayout(top);
  layout->addWidget(controls_);
  layout->addWidget(depths_);
  layout->addStretch(1);
  connect(open, &QPushButton::clicked, this, &PlacePanel::open);
  connect(remove, &QPushButton::clicked, &placement_, &Placement::remove);
  connect(reset, &QPushButton::clicked, this, &PlacePanel::reset);
  connect(&placement_, &Placement::changed, this, &PlacePanel::follow);
  connect(&placement_, &Placement::depthsChanged, this, &PlacePanel::setReach);
  setReach();
}

void PlacePanel::addControl(const char* name, const QString& label, const QString& tip,
                            double deep::Transform::*member) {
  const bool isScale = member == &deep::Transform::zScale || member == &deep::Transform::scale;
  const bool isPixels = member == &deep::Transform::x || member == &deep::Transform::y;
  Control control{new QSlider(Qt::Horizontal), new QDoubleSpinBox, member, {}, {}};
  if (isScale) {
    control.place = [](double value) { return std::log(value) / std::log(kMostScale); };
    control.value = [](double place) { return std::pow(kMostScale, place); };
  } else if (isPixels) {
    control.place = [this](double value) { return value / width_; };
    control.value = [this](double place) { return std::round(place * width_); };  // whole pixels pass bit for bit
  } else {
    control.place = [this](double value) { return std::cbrt(value / reach_); };
    control.value = [this](double place) { return cube(place) * reach_; };
  }
  control.slider->setObjectName(QString(name) + "Slider");
  control.slider->setRange(-kSteps, kSteps);
  control.slider->setTickPosition(QSlider::TicksBelow);
  control.slider->setTickInterval(kSteps);
  control.slider->setToolTip(tip);
  control.number->setObjectName(QString(name) + "Number");
  control.number->setToolTip(tip);
  control.number->setDecimals(isPixels ? 1 : 3);
  control.number->setRange(isScale ? 0.001 : -kAnyNumber, isScale ? 1000 : kAnyNumber);
  control.number->setSingleStep(isScale ? 0.05 : isPixels ? 1 : 0.1);
  control.number->setKeyboardTracking(false);
  control.number->setMaximumWidth(fontMetrics().horizontalAdvance("-00000.000") + 30);
  auto* grid = static_cast<QGridLayout*>(controls_->layout());
  const int row = grid->rowCount();
  grid->addWidget(new QLabel(label), row, 0);
  grid->addWidget(control.slider, row, 1);
  grid->addWidget(control.number, row, 2);
  connect(control.slider, &QSlider::valueChanged, this,
          [this, member, value = control.value](int at) { change(member, value(double(at) / kSteps)); });
  connect(control.number, &QDoubleSpinBox::valueChanged, this, [this, member](double value) { change(member, value); });
  connect(control.number, &QAbstractSpinBox::editingFinished, control.number, &QWidget::clearFocus);
  all_.push_back(std::move(control));
}

void PlacePanel::change(double deep::Transform::*member, double value) {
  deep::Transform transform = placement_.transform();
  transform.*member = value;
  placement_.setTransform(transform);
}

void PlacePanel::open() {
  const QString folder = session_.a() ? QFileInfo(QString::fromStdString(session_.a()->path)).path() : QString();
  const QString path = QFileDialog::getOpenFileName(this, tr("Place a volume"), folder, tr("Deep images (*.exr)"));
  if (!path.isEmpty()) placement_.open(path);
}

void PlacePanel::reset() {
  placement_.setTransform({});
}

// From behind everything to in front of it.
void PlacePanel::setReach() {
  const PlacedDepths& depths = placement_.depths();
  const double reach = std::max({std::abs(double(depths.farthest) - depths.volumeNearest),
                                 std::abs(double(depths.volumeFarthest) - depths.nearest)});
  reach_ = reach > 0 ? reach : 10;
  if (session_.a()) width_ = std::max(1, session_.a()->displayWindow().width());
  follow();
}

void PlacePanel::follow() {
  const bool active = placement_.active();
  const QString file = QString::fromStdString(placement_.file());
  name_->setText(active ? QFileInfo(file).fileName() : tr("No volume"));
  name_->setToolTip(file);
  controls_->setEnabled(active);
  remove_->setEnabled(active);
  const deep::Transform& transform = placement_.transform();
  for (const Control& control : all_) {
    const QSignalBlocker noSlider(control.slider), noNumber(control.number);
    const double value = transform.*control.member;
    if (!control.slider->isSliderDown())
      control.slider->setValue(int(std::lround(std::clamp(control.place(value), -1.0, 1.0) * kSteps)));
    control.number->setValue(value);
  }
  const PlacedDepths& depths = placement_.depths();
  const auto moved = [&](float z) { return float(double(z) * transform.zScale + transform.z); };
  depths_->setVisible(active && depths != PlacedDepths{});
  depths_->setText(tr("A lies at depths %1, the volume at %2.")
                       .arg(rangeText(depths.nearest, depths.farthest),
                            rangeText(moved(depths.volumeNearest), moved(depths.volumeFarthest))));
}

}  // namespace fathom::gui
