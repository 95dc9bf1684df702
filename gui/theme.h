// The viewer's look: dark and without hue, so that it does not colour the judgement of pictures.
#pragma once

#include <QStyle>
#include <memory>

class QApplication;

namespace fathom::gui {

// The style alone; its signs are seen on dark ground.
std::unique_ptr<QStyle> makeStyle();

void applyTheme(QApplication& application);

}  // namespace fathom::gui
