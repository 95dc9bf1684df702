#include "gui/recent_files.h"

#include <QFileInfo>
#include <QSettings>

namespace fathom::gui {

namespace {

constexpr qsizetype kMost = 12;
constexpr const char* kKey = "recent files";

}  // namespace

RecentFiles::RecentFiles(QWidget* parent) : QMenu("Open &Recent", parent) {
  // Another window may have opened something since.
  connect(this, &QMenu::aboutToShow, this, &RecentFiles::list);
  list();
}

QStringList RecentFiles::files() const {
  return QSettings().value(kKey).toStringList();
}

void RecentFiles::add(const QString& path) {
  const QString whole = QFileInfo(path).absoluteFilePath();
  QStringList all = files();
  all.removeAll(whole);
  all.prepend(whole);
  QSettings().setValue(kKey, QStringList(all.mid(0, kMost)));
  list();
}

void RecentFiles::list() {
  clear();
  for (const QString& path : files())
    connect(addAction(QString(path).replace('&', "&&")), &QAction::triggered, this,
            [this, path] { emit chosen(path); });
  setEnabled(!isEmpty());
}

}  // namespace fathom::gui
