#include "gui/compare_panel.h"

#include <QFileDialog>
#include <QFileInfo>
#include <QGridLayout>
#include <QHeaderView>
#include <QPushButton>
#include <QScrollBar>
#include <QToolButton>
#include <cmath>

namespace fathom::gui {

namespace {

constexpr int kSettle = 250;  // ms

struct Mode {
  Comparison comparison;
  const char *label, *tip;
};
constexpr Mode kModes[] = {
    {Comparison::A, "A", "A alone"},
    {Comparison::B, "B", "B alone"},
    {Comparison::Wipe, "Wipe", "A on one side of a line, B on the other"},
    {Comparison::SideBySide, "Side by side", "A at the left, B at the right"},
    {Comparison::Difference, "Difference", "A less B"},
    {Comparison::RelativeError, "Relative error", "How far A is from B, as a part of B's brightness"},
};

struct Measure {
  const char *label, *tip;
  std::optional<double> (*of)(const ComparedPart& part);
  int decimals;
};
const Measure kMeasures[] = {
    {"relMSE", "Mean of (a-b)² / (b² + 0.01)", [](const auto& p) { return std::optional(p.relMse); }, 5},
    {"without worst", "relMSE without the worst 0.1 % of the pixels", [](const auto& p) { return p.relMseTrimmed; }, 5},
    {"MSE", "Mean of (a-b)²", [](const auto& p) { return std::optional(p.mse); }, 5},
    {"PSNR", "In dB, of the tone-mapped images", [](const auto& p) { return p.psnr; }, 2},
    {"SMAPE", "Mean of |a-b| / (|a| + |b| + 0.01)", [](const auto& p) { return p.smape; }, 5},
    {"SSIM", "Likeness of structures, 1 for equal ones, of the tone-mapped images",
     [](const auto& p) { return p.ssim; }, 5},
};

QString nameOf(const PicturePtr& picture) {
  return picture ? QFileInfo(QString::fromStdString(picture->path)).fileName() : QStringLiteral("–");
}

QString textOf(std::optional<double> value, int decimals) {
  if (!value) return QStringLiteral("–");
  if (!std::isfinite(*value)) return *value > 0 ? QStringLiteral("∞") : QStringLiteral("NaN");
  return QString::number(*value, 'f', decimals);
}

// The planes of the view that cut something.
std::vector<float> clipsOf(const ViewState& view) {
  std::vector<float> clips;
  for (const float depth : {view.clip.near, view.clip.far})
    if (std::isfinite(depth)) clips.push_back(depth);
  return clips;
}

QToolButton* makeButton(const QString& text, const QString& tip, const char* name) {
  auto* button = new QToolButton;
  button->setText(text);
  button->setToolTip(tip);
  button->setObjectName(name);
  return button;
}

QLabel* makeName() {
  auto* label = new QLabel;
  label->setTextFormat(Qt::PlainText);
  label->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  return label;
}

}  // namespace

ComparePanel::ComparePanel(Session& session, Frames& frames, QWidget* parent)
    : QWidget(parent),
      session_(session),
      frames_(frames),
      modes_(new QActionGroup(this)),
      nameA_(makeName()),
      nameB_(makeName()),
      notes_(new QLabel),
      swap_(makeButton(tr("Swap"), tr("A becomes B, and B becomes A"), "swap")),
      close_(makeButton(tr("Close"), tr("Compare with nothing"), "closeB")),
      table_(new QTableWidget) {
  auto* open = makeButton(tr("Open…"), tr("Open what A is compared with"), "openB");
  auto* grid = new QGridLayout;
  grid->addWidget(new QLabel(tr("A")), 0, 0);
  grid->addWidget(nameA_, 0, 1);
  grid->addWidget(swap_, 0, 2, 1, 2);
  grid->addWidget(new QLabel(tr("B")), 1, 0);
  grid->addWidget(nameB_, 1, 1);
  grid->addWidget(open, 1, 2);
  grid->addWidget(close_, 1, 3);
  grid->setColumnStretch(1, 1);
  auto* layout = new QVBoxLayout(this);
  layout->addLayout(grid);
  makeModes();
  makeTable();
  notes_->setWordWrap(true);
  notes_->setTextFormat(Qt::PlainText);
  layout->addWidget(table_);
  layout->addWidget(notes_);
  layout->addStretch(1);
  connect(static_cast<QToolButton*>(swap_), &QToolButton::clicked, &frames_, &Frames::swap);
  connect(static_cast<QToolButton*>(close_), &QToolButton::clicked, &frames_, &Frames::closeB);
  connect(open, &QToolButton::clicked, this, &ComparePanel::openB);
  connect(&session_, &Session::picturesChanged, this, &ComparePanel::followPictures);
  connect(&session_, &Session::viewChanged, this, &ComparePanel::followView);
  settle_.setSingleShot(true);
  settle_.setInterval(kSettle);
  connect(&settle_, &QTimer::timeout, this, &ComparePanel::measure);
  connect(&background_, &Background::failed, this, &ComparePanel::clearNumbers);
  followPictures();
  followView();
}

void ComparePanel::makeModes() {
  auto* grid = new QGridLayout;
  grid->setSpacing(2);
  int place = 0;
  for (const Mode& mode : kModes) {
    auto* action = new QAction(tr(mode.label), this);
    action->setToolTip(tr(mode.tip));
    action->setCheckable(true);
    action->setData(int(mode.comparison));
    modes_->addAction(action);
    auto* button = new QToolButton;
    button->setDefaultAction(action);
    button->setAutoRaise(true);
    button->setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Preferred);
    grid->addWidget(button, place / 2, place % 2);
    ++place;
  }
  static_cast<QVBoxLayout*>(layout())->addLayout(grid);
  connect(modes_, &QActionGroup::triggered, this,
          [this](const QAction* action) { setMode(Comparison(action->data().toInt())); });
}

void ComparePanel::makeTable() {
  table_->setRowCount(int(std::size(kMeasures)));
  for (int row = 0; row < table_->rowCount(); ++row) {
    auto* header = new QTableWidgetItem(QString::fromUtf8(kMeasures[row].label));
    header->setToolTip(QString::fromUtf8(kMeasures[row].tip));
    table_->setVerticalHeaderItem(row, header);
  }
  table_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table_->setFocusPolicy(Qt::ClickFocus);
  table_->horizontalHeader()->setSectionResizeMode(QHeaderView::Stretch);
  table_->horizontalHeader()->setMinimumSectionSize(fontMetrics().horizontalAdvance("in front of 00.00"));
  table_->verticalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  table_->setVerticalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  table_->setHorizontalScrollMode(QAbstractItemView::ScrollPerPixel);
}

void ComparePanel::setMode(Comparison mode) {
  ViewState view = session_.view();
  view.comparison = mode;
  session_.setView(view);
}

void ComparePanel::toggle() {
  if (session_.b()) setMode(session_.view().comparison == Comparison::A ? Comparison::B : Comparison::A);
}

void ComparePanel::openB() {
  const QString folder = session_.a() ? QFileInfo(QString::fromStdString(session_.a()->path)).path() : QString();
  const QString path =
      QFileDialog::getOpenFileName(this, tr("Compare with"), folder, tr("Images (*.exr);;All files (*)"));
  if (!path.isEmpty()) frames_.openB(path);
}

void ComparePanel::followPictures() {
  for (auto [label, picture] : {std::pair{nameA_, session_.a()}, std::pair{nameB_, session_.b()}}) {
    label->setText(nameOf(picture));
    label->setToolTip(picture ? QString::fromStdString(picture->path) : QString());
  }
  const bool both = session_.a() && session_.b();
  swap_->setEnabled(both);
  close_->setEnabled(session_.b() != nullptr);
  for (QAction* action : modes_->actions()) action->setEnabled(both || action->data().toInt() == int(Comparison::A));
  if (!session_.b() && !frames_.b() && session_.view().comparison != Comparison::A) setMode(Comparison::A);
  if (!both) clearNumbers(tr("Open a B to compare A with."));
  settle_.start();
}

void ComparePanel::followView() {
  for (QAction* action : modes_->actions())
    if (action->data().toInt() == int(session_.view().comparison)) action->setChecked(true);
  if (clipsOf(session_.view()) != measuredClips_) settle_.start();
}

void ComparePanel::showEvent(QShowEvent* event) {
  QWidget::showEvent(event);
  settle_.start();
}

void ComparePanel::measure() {
  if (!isVisible() || !session_.a() || !session_.b()) return;
  if (frames_.player().playing()) return settle_.start();  // that needs the processor more
  const PicturePtr a = session_.a(), b = session_.b();
  const std::vector<float> clips = clipsOf(session_.view());
  if (a == measuredA_.lock() && b == measuredB_.lock() && clips == measuredClips_) return;
  background_.clear();
  measuredA_ = a;
  measuredB_ = b;
  measuredClips_ = clips;
  background_.run([this, a, b, clips](const Progress& progress) -> Background::Deliver {
    return [this, numbers = compareNumbers(*a, *b, clips, progress)] { showNumbers(numbers); };
  });
}

void ComparePanel::showNumbers(const ComparedNumbers& numbers) {
  table_->setColumnCount(int(numbers.parts.size()));
  for (int column = 0; column < table_->columnCount(); ++column) {
    const ComparedPart& part = numbers.parts[size_t(column)];
    table_->setHorizontalHeaderItem(column, new QTableWidgetItem(QString::fromStdString(part.name)));
    for (int row = 0; row < table_->rowCount(); ++row) {
      auto* item = new QTableWidgetItem(textOf(kMeasures[row].of(part), kMeasures[row].decimals));
      item->setTextAlignment(Qt::AlignRight | Qt::AlignVCenter);
      table_->setItem(row, column, item);
    }
  }
  int height = table_->horizontalHeader()->sizeHint().height() + 2 * table_->frameWidth();
  for (int row = 0; row < table_->rowCount(); ++row) height += table_->rowHeight(row);
  const bool wide =
      table_->columnCount() * table_->horizontalHeader()->minimumSectionSize() > table_->viewport()->width();
  table_->setFixedHeight(height + (wide ? table_->horizontalScrollBar()->sizeHint().height() : 0));
  table_->show();
  QStringList notes;
  for (const std::string& note : numbers.notes) notes << QString::fromStdString(note);
  notes_->setText(notes.join('\n'));
  notes_->setVisible(!notes.isEmpty());
  emit measured();
}

void ComparePanel::clearNumbers(const QString& why) {
  background_.clear();
  measuredA_.reset();
  measuredB_.reset();
  table_->setColumnCount(0);
  table_->hide();
  notes_->setText(why);
  notes_->show();
  emit measured();
}

}  // namespace fathom::gui
