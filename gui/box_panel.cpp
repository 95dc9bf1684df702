#include "gui/box_panel.h"

#include <QHeaderView>
#include <QPainter>
#include <QStyledItemDelegate>
#include <QVBoxLayout>
#include <algorithm>

#include "gui/pixel_samples.h"

namespace fathom::gui {

namespace {

constexpr int kPartRole = Qt::UserRole;  // the length of a cell's bar, of 1
constexpr size_t kMostBins = 1000;       // that are listed

// A bar behind the number.
class BarDelegate : public QStyledItemDelegate {
 public:
  using QStyledItemDelegate::QStyledItemDelegate;

  void paint(QPainter* painter, const QStyleOptionViewItem& option, const QModelIndex& index) const override {
    const double part = std::clamp(index.data(kPartRole).toDouble(), 0.0, 1.0);
    QRectF bar = QRectF(option.rect).adjusted(2, 2, -2, -2);
    bar.setWidth(bar.width() * part);
    QColor colour = option.palette.color(QPalette::Highlight);
    colour.setAlpha(110);
    painter->fillRect(bar, colour);
    QStyledItemDelegate::paint(painter, option, index);
  }
};

QTableWidget* makeTable(const QStringList& columns, QWidget* parent) {
  auto* table = new QTableWidget(0, int(columns.size()), parent);
  table->setHorizontalHeaderLabels(columns);
  table->horizontalHeader()->setSectionResizeMode(QHeaderView::Stretch);
  table->verticalHeader()->hide();
  table->verticalHeader()->setDefaultSectionSize(table->fontMetrics().height() + 4);
  table->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table->setSelectionMode(QAbstractItemView::NoSelection);
  table->setFocusPolicy(Qt::NoFocus);
  table->setShowGrid(false);
  table->setItemDelegate(new BarDelegate(table));
  return table;
}

void setCell(QTableWidget* table, int row, int column, const QString& text, double part = 0) {
  auto* item = new QTableWidgetItem(text);
  item->setData(kPartRole, part);
  item->setTextAlignment(Qt::AlignRight | Qt::AlignVCenter);
  table->setItem(row, column, item);
}

QString number(double value, int digits = 5) {
  return QString::number(value, 'g', digits);
}

QString percent(double part) {
  return QString("%1 %").arg(100 * part, 0, 'f', 1);
}

std::array<std::string, 3> three(const std::vector<std::string>& channels) {
  if (channels.size() != 3) return {"R", "G", "B"};  // whose absence is then said
  return {channels[0], channels[1], channels[2]};
}

}  // namespace

BoxPanel::BoxPanel(Session& session, QWidget* parent)
    : QWidget(parent),
      session_(session),
      summary_(new QLabel(this)),
      counts_(makeTable({tr("bins in a pixel"), tr("pixels"), tr("part")}, this)),
      bins_(makeTable({tr("bin"), tr("pixels"), tr("depth"), tr("seen"), tr("energy"), tr("part")}, this)) {
  summary_->setWordWrap(true);
  summary_->setTextFormat(Qt::RichText);
  summary_->setTextInteractionFlags(Qt::TextSelectableByMouse);
  auto* layout = new QVBoxLayout(this);
  layout->addWidget(summary_);
  layout->addWidget(counts_, 2);
  layout->addWidget(bins_, 3);
  connect(&session_, &Session::boxChanged, this, &BoxPanel::follow);
  connect(&session_, &Session::viewChanged, this, &BoxPanel::follow);
  connect(&session_, &Session::picturesChanged, this, &BoxPanel::follow);
  connect(&job_, &Background::failed, this, &BoxPanel::say);
  follow();
}

void BoxPanel::showEvent(QShowEvent*) {
  follow();
}

// A panel that nobody sees holds no picture.
void BoxPanel::hideEvent(QHideEvent* event) {
  QWidget::hideEvent(event);
  requested_.reset();
}

void BoxPanel::follow() {
  const PicturePtr& picture = session_.seen();
  if (!picture || !session_.box())
    return forget(tr("Drag a box in the picture with the shift key held: what its pixels have in common stands here."));
  if (!picture->deep()) return forget(tr("A flat picture has no bins."));
  if (!isVisible()) return;
  const Request request{picture, *session_.box(), session_.view().layer};
  if (request == requested_) return describe();
  if (requested_ && requested_->picture != picture) job_.clear();
  requested_ = request;
  job_.run([this, request](const Progress&) {
    const deep::BoxStatistics found = deep::boxStatistics(*request.picture->deep(), request.box,
                                                          three(colourChannels(*request.picture, request.layer)));
    return [this, found] { show(found); };
  });
}

void BoxPanel::forget(const QString& why) {
  job_.clear();
  requested_.reset();
  say(why);
}

void BoxPanel::say(const QString& text) {
  shown_.reset();
  summary_->setText(text.toHtmlEscaped());
  counts_->setVisible(false);
  bins_->setVisible(false);
}

void BoxPanel::show(const deep::BoxStatistics& statistics) {
  if (statistics.counts.pixels == 0) return say(tr("The box lies outside of the picture."));
  shown_ = statistics;
  describe();
  showCounts();
  showBins();
  emit ready();
}

// Again where the exposure changes.
void BoxPanel::describe() {
  if (!shown_) return;
  const deep::Statistics& counts = shown_->counts;
  const Box& box = shown_->box;
  const auto& colour = shown_->colour;
  const QString swatch = displayColour(colour[0], colour[1], colour[2], session_.view().display.exposure).name();
  QString text = tr("<b>%1 x %2</b> pixels at %3 %4<br>").arg(box.width()).arg(box.height()).arg(box.x0).arg(box.y0);
  text += tr("<b>%1</b> bins, %2 a pixel, %3 at most, at %4 %5<br>")
              .arg(counts.samples)
              .arg(double(counts.samples) / double(counts.pixels), 0, 'f', 2)
              .arg(counts.mostSamples)
              .arg(counts.mostX)
              .arg(counts.mostY);
  if (counts.nearest <= counts.farthest)
    text += tr("depth <b>%1</b> to <b>%2</b><br>").arg(number(double(counts.nearest)), number(double(counts.farthest)));
  text += tr("mean <span style='color:%1'>&#9632;</span> %2 %3 %4, alpha %5")
              .arg(swatch, number(colour[0]), number(colour[1]), number(colour[2]), number(shown_->alpha));
  if (shown_->bins.size() > kMostBins) text += tr("<br>The first %1 bins:").arg(kMostBins);
  summary_->setText(text);
}

void BoxPanel::showCounts() {
  const deep::Statistics& counts = shown_->counts;
  counts_->setRowCount(0);
  for (size_t bucket = 0; bucket < counts.histogram.size(); ++bucket) {
    if (counts.histogram[bucket] == 0) continue;
    const int row = counts_->rowCount();
    counts_->insertRow(row);
    const double part = double(counts.histogram[bucket]) / double(counts.pixels);
    setCell(counts_, row, 0, QString::fromStdString(deep::Statistics::bucketName(bucket)));
    setCell(counts_, row, 1, QString::number(counts.histogram[bucket]));
    setCell(counts_, row, 2, percent(part), part);
  }
  counts_->setVisible(true);
}

void BoxPanel::showBins() {
  double energy = 0;
  for (const deep::BinStatistics& bin : shown_->bins) energy += bin.energy;
  bins_->setRowCount(int(std::min(shown_->bins.size(), kMostBins)));
  for (int row = 0; row < bins_->rowCount(); ++row) {
    const deep::BinStatistics& bin = shown_->bins[size_t(row)];
    const double pixels = double(bin.pixels) / double(shown_->counts.pixels);
    const double part = energy > 0 ? bin.energy / energy : 0;
    setCell(bins_, row, 0, QString::number(row));
    setCell(bins_, row, 1, percent(pixels), pixels);
    setCell(bins_, row, 2, number(bin.depth));
    setCell(bins_, row, 3, number(bin.alpha, 3), bin.alpha);
    setCell(bins_, row, 4, number(bin.energy, 3));
    setCell(bins_, row, 5, percent(part), part);
  }
  bins_->setVisible(true);
}

}  // namespace fathom::gui
