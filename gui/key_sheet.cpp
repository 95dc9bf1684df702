#include "gui/key_sheet.h"

#include <QAction>
#include <QGridLayout>
#include <QGroupBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QMenu>
#include <QMenuBar>

namespace fathom::gui {

namespace {

using Rows = QList<QPair<QString, QString>>;

QString withoutMnemonic(QString text) {
  return text.remove('&');
}

QString keysOf(const QAction& action) {
  QStringList keys;
  for (const QKeySequence& sequence : action.shortcuts()) keys << sequence.toString(QKeySequence::NativeText);
  return keys.join(", ");
}

Rows rowsOf(const QMenu& menu) {
  Rows rows;
  for (const QAction* action : menu.actions())
    if (!action->shortcuts().isEmpty()) rows.append({keysOf(*action), withoutMnemonic(action->text())});
  return rows;
}

QGroupBox* group(const QString& title, const Rows& rows) {
  auto* box = new QGroupBox(title);
  auto* grid = new QGridLayout(box);
  for (int i = 0; i < rows.size(); ++i) {
    auto* key = new QLabel("<b>" + rows[i].first.toHtmlEscaped() + "</b>");
    grid->addWidget(key, i, 0);
    grid->addWidget(new QLabel(rows[i].second), i, 1);
  }
  grid->setColumnStretch(1, 1);
  grid->setRowStretch(int(rows.size()), 1);
  return box;
}

}  // namespace

KeySheet::KeySheet(const QMenuBar& menus, const Rows& gestures, QWidget* parent) : QDialog(parent) {
  setWindowTitle("Keys");
  constexpr int kColumns = 3;
  auto* grid = new QGridLayout(this);
  int count = 0;
  const auto put = [&](QGroupBox* box) {
    grid->addWidget(box, count / kColumns, count % kColumns);
    ++count;
  };
  for (const QAction* menu : menus.actions()) {
    const Rows rows = menu->menu() ? rowsOf(*menu->menu()) : Rows();
    if (!rows.isEmpty()) put(group(withoutMnemonic(menu->text()), rows));
  }
  put(group("Mouse", gestures));
}

}  // namespace fathom::gui
