#include "gui/theme.h"

#include <QApplication>
#include <QIcon>
#include <QPainter>
#include <QPalette>
#include <QPolygonF>
#include <QProxyStyle>
#include <QStyleFactory>

namespace fathom::gui {

namespace {

QPalette darkPalette() {
  const QColor window(46, 46, 46), base(34, 34, 34), text(214, 214, 214), faint(128, 128, 128), accent(196, 128, 48);
  QPalette palette;
  palette.setColor(QPalette::Window, window);
  palette.setColor(QPalette::WindowText, text);
  palette.setColor(QPalette::Base, base);
  palette.setColor(QPalette::AlternateBase, QColor(40, 40, 40));
  palette.setColor(QPalette::Text, text);
  palette.setColor(QPalette::PlaceholderText, faint);
  palette.setColor(QPalette::Button, QColor(58, 58, 58));
  palette.setColor(QPalette::ButtonText, text);
  palette.setColor(QPalette::BrightText, Qt::white);
  palette.setColor(QPalette::ToolTipBase, base);
  palette.setColor(QPalette::ToolTipText, text);
  palette.setColor(QPalette::Highlight, accent);
  palette.setColor(QPalette::HighlightedText, Qt::black);
  palette.setColor(QPalette::Link, accent.lighter());
  palette.setColor(QPalette::Light, QColor(78, 78, 78));
  palette.setColor(QPalette::Midlight, QColor(66, 66, 66));
  palette.setColor(QPalette::Mid, QColor(40, 40, 40));
  palette.setColor(QPalette::Dark, QColor(28, 28, 28));
  palette.setColor(QPalette::Shadow, QColor(16, 16, 16));
  for (const QPalette::ColorRole role : {QPalette::WindowText, QPalette::Text, QPalette::ButtonText})
    palette.setColor(QPalette::Disabled, role, QColor(104, 104, 104));
  return palette;
}

// What a bar shows where it has more than there is room for.
QIcon moreIcon() {
  constexpr int kSize = 12;
  const double ratio = qGuiApp->devicePixelRatio();
  QPixmap pixmap(QSize(kSize, kSize) * ratio);
  pixmap.setDevicePixelRatio(ratio);
  pixmap.fill(Qt::transparent);
  QPainter painter(&pixmap);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setPen(QPen(darkPalette().color(QPalette::ButtonText), 1.5));
  for (const double left : {2.0, 6.0}) painter.drawPolyline(QPolygonF({{left, 2}, {left + 4, 6}, {left, 10}}));
  return QIcon(pixmap);
}

// Fusion, whose own sign for that is black whatever the palette.
class DarkStyle : public QProxyStyle {
 public:
  DarkStyle() : QProxyStyle(QStyleFactory::create("Fusion")) {}

  QIcon standardIcon(StandardPixmap which, const QStyleOption* option, const QWidget* widget) const override {
    return which == SP_ToolBarHorizontalExtensionButton ? moreIcon() : QProxyStyle::standardIcon(which, option, widget);
  }
};

}  // namespace

std::unique_ptr<QStyle> makeStyle() {
  return std::make_unique<DarkStyle>();
}

void applyTheme(QApplication& application) {
  application.setStyle(makeStyle().release());
  application.setPalette(darkPalette());
  application.setStyleSheet(
      "QToolBar { border: 0; spacing: 4px; padding: 2px; } QDockWidget::title { padding: 4px; }"
      "QStatusBar::item { border: 0; }");
}

}  // namespace fathom::gui
