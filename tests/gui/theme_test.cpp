#include "gui/theme.h"

#include <gtest/gtest.h>

#include <QIcon>
#include <QImage>

namespace fathom::gui {
namespace {

TEST(Theme, TheSignForMoreIsSeenOnDarkGround) {
  const QImage image = makeStyle()->standardIcon(QStyle::SP_ToolBarHorizontalExtensionButton).pixmap(12).toImage();
  int light = 0;
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) light += qAlpha(image.pixel(x, y)) > 100 && qGray(image.pixel(x, y)) > 150;
  EXPECT_GT(light, 8);
}

}  // namespace
}  // namespace fathom::gui
