// The files opened last, newest first, kept between runs.
#pragma once

#include <QMenu>
#include <QStringList>

namespace fathom::gui {

class RecentFiles : public QMenu {
  Q_OBJECT

 public:
  explicit RecentFiles(QWidget* parent = nullptr);

  QStringList files() const;

  void add(const QString& path);

 signals:
  void chosen(const QString& path);

 private:
  void list();
};

}  // namespace fathom::gui
