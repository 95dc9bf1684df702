#include "gui/inspector_panel.h"

#include <QFileInfo>
#include <QHBoxLayout>
#include <QMenu>
#include <QSplitter>
#include <QVBoxLayout>
#include <utility>

namespace fathom::gui {

namespace {

constexpr int kSoon = 12;  // milliseconds

QToolButton* makeButton(QAction* action, QWidget* parent) {
  auto* button = new QToolButton(parent);
  button->setDefaultAction(action);
  button->setAutoRaise(!action->isCheckable());
  return button;
}

}  // namespace

InspectorPanel::InspectorPanel(Session& session, QWidget* parent)
    : QWidget(parent),
      session_(session),
      unpin_(tr("Unpin"), this),
      logarithmic_(tr("Log depth"), this),
      place_(new QLabel(this)),
      state_(new QLabel(this)),
      tabs_(new QTabWidget(this)),
      plot_(new DepthPlot(this)),
      table_(new SampleTable(this)),
      slice_(new DepthSlice(session, this)),
      box_(new BoxPanel(session, this)) {
  place_->setObjectName("place");
  state_->setObjectName("state");
  state_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  logarithmic_.setCheckable(true);
  logarithmic_.setToolTip(tr("Depths by their logarithm"));
  unpin_.setToolTip(tr("Follow the cursor again"));

  auto* copy = new QToolButton(this);
  copy->setText(tr("Copy"));
  copy->setAutoRaise(true);
  copy->setPopupMode(QToolButton::InstantPopup);
  auto* menu = new QMenu(copy);
  menu->addActions({copyTsvAction(), copyJsonAction()});
  copy->setMenu(menu);

  auto* head = new QHBoxLayout;
  head->addWidget(place_);
  head->addWidget(unpinButton_ = makeButton(&unpin_, this));
  head->addWidget(state_, 1);
  head->addWidget(makeButton(&logarithmic_, this));
  head->addWidget(copy);

  auto* samples = new QSplitter(Qt::Vertical, this);
  samples->addWidget(plot_);
  samples->addWidget(table_);
  samples->setStretchFactor(0, 2);
  samples->setStretchFactor(1, 3);
  tabs_->setDocumentMode(true);
  tabs_->addTab(samples, tr("Samples"));
  tabs_->addTab(slice_, tr("Slice"));
  tabs_->addTab(box_, tr("Box"));

  tabs_->setTabToolTip(0, tr("The plot: the wheel looks closer, a double click shows all.\n"
                             "The table: a click on a column sorts, a right click on it chooses columns."));
  tabs_->setTabToolTip(1, tr("The row seen from above. The wheel looks closer, with Ctrl in depth;\n"
                             "a double click shows all, a click pins that column."));
  tabs_->setTabToolTip(2, tr("The box that was dragged in the picture with the shift key"));

  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(6, 4, 6, 6);
  layout->addLayout(head);
  layout->addWidget(tabs_, 1);

  soon_.setSingleShot(true);
  connect(&soon_, &QTimer::timeout, this, &InspectorPanel::follow);
  const auto later = [this] {
    if (!soon_.isActive()) soon_.start(kSoon);
  };
  connect(&session_, &Session::pixelChanged, this, later);
  connect(&session_, &Session::picturesChanged, this, &InspectorPanel::follow);
  connect(&session_, &Session::viewChanged, this, &InspectorPanel::followView);
  connect(&unpin_, &QAction::triggered, this, [this] { session_.setPin({}); });
  connect(&logarithmic_, &QAction::toggled, plot_, &DepthPlot::setLogarithmic);
  connect(&logarithmic_, &QAction::toggled, slice_, &DepthSlice::setLogarithmic);
  connect(&reader_, &Background::failed, &session_, &Session::say);
  connect(table_, &SampleTable::failed, &session_, &Session::say);
  connect(table_, &SampleTable::hovered, this, &InspectorPanel::highlight);
  connect(plot_, &DepthPlot::hovered, this, [this](int sample) {
    highlight(sample);
    table_->reveal(sample);
  });
  followView();
}

PixelSamples InspectorPanel::answer(const Request& request) {
  if (request.pixel) return samplesAt(request.picture, *request.pixel, request.layer, request.stops);
  PixelSamples none;
  none.picture = request.picture;
  return none;
}

void InspectorPanel::follow() {
  soon_.stop();
  const ViewState& view = session_.view();
  Request request{session_.seen(), session_.pixel(), view.layer, view.display.exposure};
  if (std::exchange(shown_, request) != request) {
    reader_.clear();
    if (countAt(request.picture, request.pixel) <= kManySamples)
      showSamples(answer(request));
    else
      reader_.run([this, request = std::move(request)](const Progress&) {
        return [this, samples = answer(request)] { showSamples(samples); };
      });
  }
  describe();
  slice_->follow();
}

void InspectorPanel::showSamples(PixelSamples samples) {
  plot_->show(samples);
  table_->samples().show(std::move(samples));
  describe();
}

void InspectorPanel::followView() {
  plot_->setClip(session_.view().clip);
  table_->samples().setClip(session_.view().clip);
  follow();
}

void InspectorPanel::highlight(int sample) {
  plot_->setHighlight(sample);
  table_->samples().setHighlight(sample);
}

void InspectorPanel::describe() {
  const PixelSamples& samples = table_->samples().samples();
  const std::optional<QPoint> pixel = session_.pixel();
  unpin_.setEnabled(session_.pin().has_value());
  unpinButton_->setVisible(unpin_.isEnabled());
  place_->setText(
      pixel ? QString("<b>%1 %2</b>%3").arg(pixel->x()).arg(pixel->y()).arg(session_.pin() ? tr(" pinned") : QString())
            : tr("no pixel"));
  QStringList state;
  if (samples.picture != shown_.picture || (pixel && samples.pixel != *pixel))
    state << tr("reading %1 samples").arg(countAt(shown_.picture, pixel));
  else if (!samples.problem.isEmpty())
    state << samples.problem;
  else if (samples.isDeep() && pixel && samples.samples.empty())
    state << tr("empty");
  else if (samples.isDeep() && pixel)
    state << tr("%1, alpha %2")
                 .arg(samples.samples.size() == 1 ? tr("1 sample") : tr("%1 samples").arg(samples.samples.size()))
                 .arg(samples.alpha(), 0, 'g', 3);
  if (session_.a() && session_.b())
    state << QString("%1: %2").arg(session_.seen() == session_.b() ? "B" : "A",
                                   QFileInfo(QString::fromStdString(session_.seen()->path)).fileName());
  state_->setText(state.join("    "));
  state_->setToolTip(state_->text());
}

}  // namespace fathom::gui
