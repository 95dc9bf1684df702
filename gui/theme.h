// The viewer's look: dark and without hue, so that it does not colour the judgement of pictures.
#pragma once

class QApplication;

namespace fathom::gui {

void applyTheme(QApplication& application);

}  // namespace fathom::gui
