// The sheet of keys: made from the menus, so that it cannot say anything else than they do.
#pragma once

#include <QDialog>

class QMenuBar;

namespace fathom::gui {

class KeySheet : public QDialog {
  Q_OBJECT

 public:
  // `gestures`: what the mouse does, by pairs of gesture and effect.
  KeySheet(const QMenuBar& menus, const QList<QPair<QString, QString>>& gestures, QWidget* parent = nullptr);
};

}  // namespace fathom::gui
