#include "gui/sample_table.h"

#include <QClipboard>
#include <QContextMenuEvent>
#include <QFontDatabase>
#include <QGuiApplication>
#include <QHeaderView>
#include <QMenu>
#include <algorithm>

#include "base/error.h"

namespace fathom::gui {

namespace {

constexpr int kSwatch = 14;

}  // namespace

SampleTable::SampleTable(QWidget* parent)
    : QTableView(parent), copyTsv_(tr("Copy as &TSV"), this), copyJson_(tr("Copy as &JSON"), this) {
  order_.setSourceModel(&model_);
  setModel(&order_);
  setSortingEnabled(true);
  sortByColumn(-1, Qt::AscendingOrder);  // as stored
  setSelectionBehavior(SelectRows);
  setEditTriggers(NoEditTriggers);
  setMouseTracking(true);
  setAlternatingRowColors(true);
  setShowGrid(false);
  setWordWrap(false);
  setIconSize({kSwatch, kSwatch});
  QFont digits = QFontDatabase::systemFont(QFontDatabase::FixedFont);
  digits.setPointSizeF(digits.pointSizeF() * 0.9);
  setFont(digits);
  verticalHeader()->hide();
  verticalHeader()->setDefaultSectionSize(fontMetrics().height() + 4);
  horizontalHeader()->setContextMenuPolicy(Qt::CustomContextMenu);
  horizontalHeader()->setSectionsMovable(true);
  horizontalHeader()->setDefaultSectionSize(fontMetrics().horizontalAdvance("-1.2345e-05") + 8);
  connect(horizontalHeader(), &QWidget::customContextMenuRequested, this, &SampleTable::showColumnMenu);
  connect(&model_, &QAbstractItemModel::modelReset, this, &SampleTable::applyColumns);
  connect(this, &QAbstractItemView::entered, this,
          [this](const QModelIndex& at) { emit hovered(order_.mapToSource(at).row()); });
  connect(this, &QAbstractItemView::viewportEntered, this, [this] { emit hovered(-1); });
  copyTsv_.setShortcut(QKeySequence::Copy);
  copyJson_.setShortcut(QKeySequence("Ctrl+Shift+C"));
  for (QAction* action : {&copyTsv_, &copyJson_}) {
    action->setShortcutContext(Qt::WidgetWithChildrenShortcut);
    addAction(action);
  }
  connect(&copyTsv_, &QAction::triggered, this, [this] { copy(false); });
  connect(&copyJson_, &QAction::triggered, this, [this] { copy(true); });
}

void SampleTable::setColumnShown(const QString& name, bool shown) {
  chosen_[name] = shown;
  applyColumns();
}

void SampleTable::reveal(int sample) {
  if (sample >= 0 && sample < model_.rowCount()) scrollTo(order_.mapFromSource(model_.index(sample, 0)));
}

void SampleTable::leaveEvent(QEvent* event) {
  emit hovered(-1);
  QTableView::leaveEvent(event);
}

void SampleTable::contextMenuEvent(QContextMenuEvent* event) {
  QMenu menu;
  menu.addActions({&copyTsv_, &copyJson_});
  menu.exec(event->globalPos());
}

void SampleTable::applyColumns() {
  for (int column = 0; column < model_.columnCount(); ++column) {
    const auto chosen = chosen_.find(model_.columnName(column));
    setColumnHidden(column, chosen == chosen_.end() ? !model_.isUsual(column) : !chosen->second);
    const QString& name = model_.columnName(column);
    if (name == "#") setColumnWidth(column, fontMetrics().horizontalAdvance("0000") + 14);
    if (name == "colour") setColumnWidth(column, fontMetrics().horizontalAdvance("colour") + 14);
  }
}

void SampleTable::showColumnMenu(const QPoint& at) {
  QMenu menu;
  const auto showAll = [this](auto shown) {
    for (int column = 0; column < model_.columnCount(); ++column) chosen_[model_.columnName(column)] = shown(column);
    applyColumns();
  };
  menu.addAction(tr("Show all"), this, [&] { showAll([](int) { return true; }); });
  menu.addAction(tr("Show the usual"), this, [&] { showAll([this](int column) { return model_.isUsual(column); }); });
  menu.addSeparator();
  for (int column = 0; column < model_.columnCount(); ++column) {
    QAction* action = menu.addAction(model_.columnName(column));
    action->setCheckable(true);
    action->setChecked(!isColumnHidden(column));
    connect(action, &QAction::toggled, this,
            [this, name = model_.columnName(column)](bool shown) { setColumnShown(name, shown); });
  }
  menu.exec(horizontalHeader()->mapToGlobal(at));
}

void SampleTable::copy(bool json) {
  try {
    const std::vector<int> rows = chosenRows();
    QGuiApplication::clipboard()->setText(json ? model_.json(rows) : model_.tsv(rows, shownColumns()));
  } catch (const Error& e) {
    emit failed(e.what());
  }
}

std::vector<int> SampleTable::chosenRows() const {
  std::vector<int> rows;
  const bool all = !selectionModel()->hasSelection();
  for (int row = 0; row < order_.rowCount(); ++row)
    if (all || selectionModel()->isRowSelected(row, {})) rows.push_back(order_.mapToSource(order_.index(row, 0)).row());
  return rows;
}

std::vector<int> SampleTable::shownColumns() const {
  std::vector<int> columns;
  for (int visual = 0; visual < order_.columnCount(); ++visual) {
    const int column = horizontalHeader()->logicalIndex(visual);
    if (!isColumnHidden(column)) columns.push_back(column);
  }
  return columns;
}

}  // namespace fathom::gui
