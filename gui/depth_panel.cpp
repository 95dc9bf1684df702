#include "gui/depth_panel.h"

#include <QAction>
#include <QComboBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QSignalBlocker>
#include <QToolButton>
#include <QVBoxLayout>
#include <algorithm>
#include <limits>

#include "gui/depth_field.h"
#include "gui/histogram_view.h"

namespace fathom::gui {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kBins = 512, kTick = 33;  // milliseconds
constexpr double kStep = 0.005;         // of the axis: a key or a notch of the wheel in a field
constexpr size_t kMostMarks = 4096;

// The depths of the samples of a pixel.
std::vector<deep::Range> depthsAt(const deep::DeepImage& image, QPoint pixel) {
  std::vector<deep::Range> result;
  if (!image.dataWindow.contains(pixel.x(), pixel.y())) return result;
  const std::span<const float> z = image.tryGet("Z"), zBack = image.tryGet("ZBack");
  const size_t at = image.dataWindow.index(pixel.x(), pixel.y());
  if (z.empty()) return result;
  for (size_t i = image.offsets[at]; i < image.offsets[at + 1] && result.size() < kMostMarks; ++i)
    result.push_back(deep::usableRange(z[i], zBack.empty() ? z[i] : zBack[i]));
  return result;
}

// Lets a button that is switched on stand out.
void light(QWidget& button, bool on) {
  QPalette palette;
  if (on) palette.setColor(QPalette::Button, palette.color(QPalette::Highlight));
  if (on) palette.setColor(QPalette::ButtonText, palette.color(QPalette::HighlightedText));
  button.setPalette(palette);
}

}  // namespace

DepthPanel::DepthPanel(Session& session, QWidget* parent) : QWidget(parent), session_(session) {
  setObjectName("depth panel");
  histogram_ = new HistogramView(model_);
  auto* controls = new QHBoxLayout;
  controls->setSpacing(4);
  addRangeControls(controls);
  controls->addStretch();
  addHistogramControls(controls);
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(4, 2, 4, 4);
  layout->setSpacing(2);
  layout->addLayout(controls);
  layout->addWidget(histogram_, 1);

  ticks_.setInterval(kTick);
  connect(&ticks_, &QTimer::timeout, this, &DepthPanel::sweep);
  connect(histogram_, &HistogramView::rangeDragged, this, &DepthPanel::edit);
  connect(histogram_, &HistogramView::zoomed, this, [this] { requestHistogram(); });
  connect(&background_, &Background::failed, &session_, &Session::say);
  connect(&session_, &Session::picturesChanged, this, &DepthPanel::followPicture);
  connect(&session_, &Session::viewChanged, this, &DepthPanel::followRange);
  connect(&session_, &Session::pixelChanged, this, &DepthPanel::followPixel);
  setEnabled(false);
  animate_->setEnabled(false);
  followPicture();
  followRange();
}

QAction* DepthPanel::addAction(QHBoxLayout* row, const QString& text, const QString& tip, bool checkable) {
  auto* action = new QAction(text, this);
  action->setToolTip(tip);
  action->setCheckable(checkable);
  auto* button = new QToolButton;
  button->setDefaultAction(action);
  button->setFocusPolicy(Qt::NoFocus);
  connect(action, &QAction::toggled, button, [button](bool on) { light(*button, on); });
  row->addWidget(button);
  return action;
}

DepthField* DepthPanel::addField(QHBoxLayout* row, const QString& label, const QString& tip, float none, float least) {
  auto* field = new DepthField(none, least);
  auto* name = new QLabel(label);
  name->setBuddy(field);
  field->setObjectName(label.toLower());
  field->setToolTip(tip);
  row->addWidget(name);
  row->addWidget(field);
  return field;
}

void DepthPanel::addRangeControls(QHBoxLayout* row) {
  near_ = addField(row, "Near", "Depth where things begin to be shown; -inf or nothing: from the first", -kInfinity,
                   -kInfinity);
  far_ =
      addField(row, "Far", "Depth from where on nothing is shown; inf or nothing: to the last", kInfinity, -kInfinity);
  soft_ =
      addField(row, "Soft", "Depth over which things fade in behind the near plane and out before the far one", 0, 0);
  const auto take = [this](DepthField* field, float deep::DepthRange::*member) {
    connect(field, &DepthField::edited, this, [this, member](float value) {
      deep::DepthRange changed = range();
      changed.*member = value;
      edit(changed);
      if (!(changed.near < changed.far)) session_.say("The near plane is not before the far one: nothing is left");
    });
  };
  take(near_, &deep::DepthRange::near);
  take(far_, &deep::DepthRange::far);
  take(soft_, &deep::DepthRange::soft);
  connect(near_, &DepthField::stepped, this, [this](int steps) { move(ClipHandle::Near, steps); });
  connect(far_, &DepthField::stepped, this, [this](int steps) { move(ClipHandle::Far, steps); });
  connect(soft_, &DepthField::stepped, this, [this](int steps) {
    deep::DepthRange changed = range();
    const double length = model_.shown().far - model_.shown().near;
    changed.soft = std::max(0.0f, changed.soft + float(steps * kStep * length));
    edit(changed);
  });
  invert_ = addAction(row, "Invert", "Show what the range leaves out", true);
  animate_ = addAction(row, "Animate", "Sweep the near plane, or the slab between both, through all depths", true);
  reset_ = addAction(row, "Reset", "Show all depths", false);
  connect(invert_, &QAction::triggered, this, [this](bool on) {
    deep::DepthRange changed = range();
    changed.inverted = on;
    setRange(changed);
  });
  connect(animate_, &QAction::toggled, this, &DepthPanel::animate);
  connect(reset_, &QAction::triggered, this, &DepthPanel::reset);
}

void DepthPanel::addHistogramControls(QHBoxLayout* row) {
  weight_ = new QComboBox;
  weight_->addItem("Alpha", int(deep::DepthWeight::Seen));
  weight_->addItem("Samples", int(deep::DepthWeight::Samples));
  weight_->setToolTip("What the histogram counts: alpha as it is seen from the front, or samples");
  weight_->setFocusPolicy(Qt::ClickFocus);
  row->addWidget(weight_);
  logDepth_ = addAction(row, "Log depth", "The axis by the logarithm of depth", true);
  logCounts_ = addAction(row, "Log counts", "Bars by their logarithm, so that small ones are seen", true);
  logCounts_->setChecked(true);
  histogram_->setLogCounts(true);
  connect(weight_, &QComboBox::currentIndexChanged, this, [this] { requestHistogram(); });
  connect(logDepth_, &QAction::toggled, this, [this] { requestHistogram(); });
  connect(logCounts_, &QAction::toggled, histogram_, &HistogramView::setLogCounts);
}

void DepthPanel::setRange(const deep::DepthRange& range) {
  ViewState view = session_.view();
  view.clip = range;
  session_.setView(view);
}

void DepthPanel::edit(const deep::DepthRange& range) {
  animate_->setChecked(false);
  setRange(range);
}

void DepthPanel::move(ClipHandle handle, int steps) {
  edit(model_.moved(handle, range(), steps * kStep));
}

void DepthPanel::animate(bool on) {
  ticks_.stop();
  sweep_.reset();
  if (!on) return;
  if (known_ == seen_)
    startSweep();
  else
    requestHistogram();  // whose axis the sweep waits for
}

void DepthPanel::startSweep() {
  sweep_.emplace(model_.whole(), range());
  swept_ = range();
  time_.start();
  ticks_.start();
}

void DepthPanel::sweep() {
  if (!sweep_) return;
  deep::DepthRange next = sweep_->at(double(time_.elapsed()) / 1000);
  next.soft = range().soft;
  next.inverted = range().inverted;
  swept_ = next;
  setRange(next);
}

void DepthPanel::reset() {
  animate_->setChecked(false);
  setRange({});
  model_.showAll();
  requestHistogram();
}

void DepthPanel::followPicture() {
  if (seen_ == session_.seen()) return;
  seen_ = session_.seen();
  const bool deep = seen_ && seen_->deep();
  setEnabled(deep);
  animate_->setEnabled(deep);  // in menus, too
  if (!deep) {
    animate_->setChecked(false);
    background_.clear();
    known_ = nullptr;
    histogram_->setHistogram({}, {});
    histogram_->setMarks({});
  } else {
    requestHistogram();
    followPixel();
  }
}

void DepthPanel::followRange() {
  followPicture();  // B alone may be shown now
  if (sweep_ && (range().near != swept_.near || range().far != swept_.far)) animate_->setChecked(false);
  near_->setValue(range().near);
  far_->setValue(range().far);
  soft_->setValue(range().soft);
  invert_->setChecked(range().inverted);
  histogram_->setRange(range());
}

void DepthPanel::followPixel() {
  const bool there = seen_ && seen_->deep() && session_.pixel();
  histogram_->setMarks(there ? depthsAt(*seen_->deep(), *session_.pixel()) : std::vector<deep::Range>());
}

void DepthPanel::showEvent(QShowEvent*) {
  if (known_ != seen_) requestHistogram();
}

// Where somebody looks, or an animation needs the axis. The axis of all depths is found anew only where picture or scale
// are others than it was found for.
void DepthPanel::requestHistogram() {
  const PicturePtr picture = seen_;
  if (!picture || !picture->deep()) return;
  if (!isVisible() && !animate_->isChecked()) return known_.reset();
  const bool logarithmic = logDepth_->isChecked();
  const bool known = picture == known_ && logarithmic == knownLogarithmic_;
  const auto weight = deep::DepthWeight(weight_->currentData().toInt());
  background_.run([=, this, model = model_](const Progress& progress) {
    const deep::DeepImage& image = *picture->deep();
    const deep::DepthAxis all = known ? model.whole() : deep::axisOf(image, logarithmic);
    ClipModel next = model;
    next.setWhole(all);
    const deep::DepthAxis axis = next.shown();
    std::vector<double> bins = deep::depthHistogram(image, axis, kBins, weight, progress.stop);
    return [=, this, bins = std::move(bins)] {
      known_ = picture;
      knownLogarithmic_ = logarithmic;
      model_.setWhole(all);
      histogram_->setHistogram(axis, bins);
      if (animate_->isChecked() && !sweep_) startSweep();
      emit histogramChanged();
    };
  });
}

}  // namespace fathom::gui
