// The inspector as the user has it: real mouse and keys, and pixels of what is drawn.
#include "gui/inspector_panel.h"

#include <gtest/gtest.h>

#include <QApplication>
#include <QClipboard>
#include <QHeaderView>
#include <QSignalSpy>
#include <QTest>
#include <QWheelEvent>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/reference/deep_samples.h"

namespace fathom::gui {
namespace {

using reference::makeDeep;

// At (3, -2): red before green before blue, of which green is a volume; at (4, -2) nothing; at (5, -2) one more.
PicturePtr threeColours() {
  deep::DeepImage image =
      makeDeep({{{4, 4, 0.5f, 0, 8}, {1, 1, 0.5f, 0, 4294967295u}, {2, 3, 0.5f, 0, 9}}, {}, {{2.5f, 2.5f, 1}}}, 3);
  image.add("G", deep::PixelType::Float).values.fill(0);
  const auto set = [&](const char* channel, size_t sample) { image.get(channel)[sample] = 0.5f; };
  for (const char* name : {"R", "B"}) std::ranges::fill(image.get(name), 0.0f);
  set("B", 0);
  set("R", 1);
  set("G", 2);
  return makePicture("a.exr", std::move(image));
}

// Another one of the same size.
PicturePtr oneSample() {
  return makePicture("folder/b.exr", makeDeep({{{7, 7, 0.5f}}, {}, {}}, 3));
}

PicturePtr manySamples() {
  std::vector<reference::Sample> samples;
  for (int i = 0; i < 3000; ++i) samples.push_back({float(1 + i), float(1 + i), 0.001f});
  deep::DeepImage image = makeDeep({samples, {}, {}}, 3);
  image.add("G", deep::PixelType::Float);
  return makePicture("many.exr", std::move(image));
}

class Inspector : public ::testing::Test {
 protected:
  Inspector() {
    panel.resize(500, 700);
    panel.show();
    session.setA(threeColours());
    session.setPin(QPoint(3, -2));
    EXPECT_TRUE(QTest::qWaitFor([this] { return table->model()->rowCount() == 3; }));
  }

  QString cell(int row, const QString& name) const {
    for (int column = 0; column < table->model()->columnCount(); ++column)
      if (table->model()->headerData(column, Qt::Horizontal).toString() == name)
        return table->model()->index(row, column).data().toString();
    return "no column " + name;
  }
  int columnOf(const QString& name) const {
    int column = 0;
    while (table->model()->headerData(column, Qt::Horizontal).toString() != name) ++column;
    return column;
  }
  void clickHeader(const QString& name) {
    QHeaderView* header = table->horizontalHeader();
    const QPoint at(header->sectionViewportPosition(columnOf(name)) + 8, header->height() / 2);
    QTest::mouseClick(header->viewport(), Qt::LeftButton, {}, at);
  }
  void showAlone(Comparison comparison) {
    ViewState view = session.view();
    view.comparison = comparison;
    session.setView(view);
  }
  void setExposure(float stops) {
    ViewState view = session.view();
    view.display.exposure = stops;
    session.setView(view);
  }
  QColor plotted(const QPointF& at) const { return plot->grab().toImage().pixelColor(at.toPoint()); }

  Session session;
  InspectorPanel panel{session};
  SampleTable* table = panel.findChild<SampleTable*>();
  DepthPlot* plot = panel.findChild<DepthPlot*>();
  DepthSlice* slice = panel.findChild<DepthSlice*>();
  BoxPanel* box = panel.findChild<BoxPanel*>();
};

TEST_F(Inspector, FollowsTheCursorUntilItIsPinned) {
  session.setPin({});
  session.setCursor(QPoint(5, -2));
  ASSERT_TRUE(QTest::qWaitFor([this] { return table->model()->rowCount() == 1; }));
  EXPECT_EQ(cell(0, "Z"), "2.5");
  session.setPin(QPoint(3, -2));
  session.setCursor(QPoint(4, -2));
  ASSERT_TRUE(QTest::qWaitFor([this] { return table->model()->rowCount() == 3; }));
  EXPECT_TRUE(panel.findChild<QLabel*>("place")->text().contains("pinned"));
  panel.unpinAction()->trigger();
  ASSERT_TRUE(QTest::qWaitFor([this] { return table->model()->rowCount() == 0; }));
  EXPECT_FALSE(panel.findChild<QLabel*>("place")->text().contains("pinned"));
}

TEST_F(Inspector, PinningThePixelUnderTheCursorIsSaid) {
  session.setPin({});
  session.setCursor(QPoint(5, -2));
  session.setPin(QPoint(5, -2));
  EXPECT_TRUE(QTest::qWaitFor([this] { return panel.findChild<QLabel*>("place")->text().contains("pinned"); }));
}

TEST_F(Inspector, AClickOnTheHeaderSorts) {
  EXPECT_EQ(cell(0, "Z"), "4");
  clickHeader("Z");
  EXPECT_EQ(cell(0, "Z"), "1");
  EXPECT_EQ(cell(2, "Z"), "4");
  clickHeader("Z");
  EXPECT_EQ(cell(0, "Z"), "4");
  EXPECT_EQ(cell(2, "Z"), "1");
}

TEST_F(Inspector, KeysCopyWhatIsSelectedInTheOrderThatIsSeen) {
  clickHeader("Z");
  for (const char* name : {"A", "seen", "front", "R", "G", "B", "ZBack"}) table->setColumnShown(name, false);
  table->setFocus();
  QTest::keyClick(table, Qt::Key_C, Qt::ControlModifier);
  EXPECT_EQ(QApplication::clipboard()->text(), "#\tZ\tid\n1\t1\t4294967295\n2\t2\t9\n0\t4\t8\n");
  QTest::mouseClick(table->viewport(), Qt::LeftButton, {}, table->visualRect(table->model()->index(1, 0)).center());
  QTest::keyClick(table, Qt::Key_C, Qt::ControlModifier);
  EXPECT_EQ(QApplication::clipboard()->text(), "#\tZ\tid\n2\t2\t9\n");
  QTest::keyClick(table, Qt::Key_C, Qt::ControlModifier | Qt::ShiftModifier);
  const auto json = nlohmann::json::parse(QApplication::clipboard()->text().toStdString());
  ASSERT_EQ(json["samples"].size(), 1u);
  EXPECT_EQ(json["samples"][0]["channels"]["id"], 9);
}

TEST_F(Inspector, HiddenColumnsStayHidden) {
  table->setColumnShown("G", false);
  EXPECT_TRUE(table->isColumnHidden(columnOf("G")));
  session.setA(loadPicture(FATHOM_DEMO "/sequence.0001.deep.exr"));
  EXPECT_TRUE(table->isColumnHidden(columnOf("G")));
  EXPECT_FALSE(table->isColumnHidden(columnOf("R")));
  EXPECT_TRUE(table->isColumnHidden(columnOf("variance.R")));
  table->setColumnShown("variance.R", true);
  EXPECT_FALSE(table->isColumnHidden(columnOf("variance.R")));
}

TEST_F(Inspector, BarsStandAtTheirDepthsInTheirColours) {
  const QRectF frame = plot->frame();
  const auto x = [&](double depth) { return frame.left() + plot->axis().place(depth) * frame.width(); };
  const auto y = [&](double alpha) { return frame.bottom() - alpha * frame.height(); };
  EXPECT_EQ(plotted({x(1), y(0.05)}), QColor(255, 0, 0));
  EXPECT_EQ(plotted({x(2.2), y(0.05)}), QColor(0, 255, 0));
  EXPECT_EQ(plotted({x(2.8), y(0.2)}), QColor(0, 255, 0));
  EXPECT_EQ(plotted({x(4), y(0.05)}), QColor(0, 0, 255));
  EXPECT_NE(plotted({x(2.5), y(0.3)}), QColor(0, 255, 0));  // alpha, of which the half is seen
  const QColor nothing = plot->palette().color(QPalette::Base);
  EXPECT_EQ(plotted({x(1.55), y(0.05)}), nothing);
  EXPECT_EQ(plotted({x(3.5), y(0.05)}), nothing);
  // The transmittance: 1, then 1/2, then 1/4.
  EXPECT_NE(plotted({x(1.53), y(0.5)}), plotted({x(3.53), y(0.5)}));
  EXPECT_NE(plotted({x(3.53), y(0.25)}), nothing);
}

TEST_F(Inspector, ClippedDepthsAreDimmed) {
  const QRectF frame = plot->frame();
  const QPointF red(frame.left() + plot->axis().place(1) * frame.width(), frame.bottom() - 12);
  EXPECT_EQ(plotted(red), QColor(255, 0, 0));
  ViewState view;
  view.clip.near = 1.5f;
  session.setView(view);
  EXPECT_NE(plotted(red), QColor(255, 0, 0));
  view.clip.inverted = true;
  session.setView(view);
  EXPECT_EQ(plotted(red), QColor(255, 0, 0));
}

TEST_F(Inspector, BarAndRowStandOutTogether) {
  clickHeader("Z");
  const auto rowStandsOut = [this](int row) {
    return table->model()->index(row, 0).data(Qt::BackgroundRole).isValid();
  };
  QTest::mouseMove(plot, plot->bar(2, 0.3).center().toPoint());
  EXPECT_FALSE(rowStandsOut(0));
  EXPECT_TRUE(rowStandsOut(1));
  const QColor before = plotted(plot->bar(0, 0.5).topLeft());
  QTest::mouseMove(table->viewport(), table->visualRect(table->model()->index(2, 0)).center());
  EXPECT_TRUE(QTest::qWaitFor([&] { return rowStandsOut(2); }));
  EXPECT_NE(plotted(plot->bar(0, 0.5).topLeft()), before);
}

TEST_F(Inspector, TheWheelLooksCloser) {
  const deep::DepthAxis before = plot->axis();
  const QPointF at = plot->frame().center();
  QWheelEvent wheel(at, plot->mapToGlobal(at), {}, {0, 120}, {}, {}, Qt::NoScrollPhase, false);
  QApplication::sendEvent(plot, &wheel);
  EXPECT_NEAR(plot->axis().depth(0.5), before.depth(0.5), 1e-9);
  EXPECT_LT(plot->axis().far, before.far);
  QTest::mouseDClick(plot, Qt::LeftButton, {}, at.toPoint());
  EXPECT_EQ(plot->axis(), before);
}

TEST_F(Inspector, TheSliceShowsTheRow) {
  QSignalSpy ready(slice, &DepthSlice::ready);
  panel.showTab(InspectorPanel::Tab::Slice);
  ASSERT_TRUE(!ready.empty() || ready.wait());
  const QImage image = slice->grab().toImage();
  const auto at = [&](double x, double depth) { return image.pixelColor(slice->placeOf(x, depth).toPoint()); };
  EXPECT_GT(at(3.5, 2.3).green(), 200);
  EXPECT_GT(at(3.5, 2.3).green(), 2 * at(3.5, 2.3).red());
  EXPECT_GT(at(3.5, 1).red(), 2 * at(3.5, 1).blue());
  EXPECT_GT(at(3.5, 4).blue(), 2 * at(3.5, 4).red());
  EXPECT_EQ(at(4.5, 2.3), slice->palette().color(QPalette::Base));
  EXPECT_EQ(at(3.5, 3.3), slice->palette().color(QPalette::Base));
  QTest::mouseClick(slice, Qt::LeftButton, {}, slice->placeOf(5.5, 2).toPoint());
  EXPECT_EQ(session.pin(), QPoint(5, -2));
}

TEST_F(Inspector, TheWheelLooksCloserAtTheSlice) {
  QSignalSpy ready(slice, &DepthSlice::ready);
  panel.showTab(InspectorPanel::Tab::Slice);
  ASSERT_TRUE(!ready.empty() || ready.wait());
  const QPointF at = slice->placeOf(3.5, 2.5), other = slice->placeOf(3.5, 3);
  QWheelEvent wheel(at, slice->mapToGlobal(at), {}, {0, 120}, {}, Qt::ControlModifier, Qt::NoScrollPhase, false);
  for (int i = 1; i <= 2; ++i) {
    QApplication::sendEvent(slice, &wheel);
    ASSERT_TRUE(ready.wait());
    EXPECT_NEAR(slice->placeOf(3.5, 2.5).y(), at.y(), 1e-6);
    EXPECT_NEAR(slice->placeOf(3.5, 3).y() - at.y(), (other.y() - at.y()) / std::pow(0.8, i), 1e-6);
  }
  QTest::mouseDClick(slice, Qt::LeftButton, {}, at.toPoint());
  ASSERT_TRUE(ready.wait());
  EXPECT_NEAR(slice->placeOf(3.5, 3).y(), other.y(), 1e-6);
}

TEST_F(Inspector, TheSliceKeepsZoomAndImageUntilTheNextPictureIsThere) {
  QSignalSpy ready(slice, &DepthSlice::ready);
  panel.showTab(InspectorPanel::Tab::Slice);
  ASSERT_TRUE(!ready.empty() || ready.wait());
  const QPointF at = slice->placeOf(3.5, 2.5);
  QWheelEvent wheel(at, slice->mapToGlobal(at), {}, {0, 240}, {}, Qt::ControlModifier, Qt::NoScrollPhase, false);
  QApplication::sendEvent(slice, &wheel);
  ASSERT_TRUE(ready.wait());
  const QPointF zoomed = slice->placeOf(3.5, 3);
  const QImage before = slice->grab().toImage();
  session.setPin({});
  session.setA(threeColours());
  EXPECT_EQ(slice->grab().toImage().pixelColor(at.toPoint()), before.pixelColor(at.toPoint()));
  ASSERT_TRUE(ready.wait());
  EXPECT_EQ(slice->placeOf(3.5, 3), zoomed);
}

TEST_F(Inspector, TheSliceFollowsTheClipWithoutANewOne) {
  QSignalSpy ready(slice, &DepthSlice::ready);
  panel.showTab(InspectorPanel::Tab::Slice);
  ASSERT_TRUE(!ready.empty() || ready.wait());
  const auto volume = [this] { return slice->grab().toImage().pixelColor(slice->placeOf(3.5, 2.3).toPoint()); };
  const QColor before = volume();
  ViewState view;
  view.clip.near = 3.5f;
  session.setView(view);
  EXPECT_NE(volume(), before);
  QApplication::processEvents();
  EXPECT_EQ(ready.size(), 1);
}

TEST_F(Inspector, TheBoxInNumbers) {
  QSignalSpy ready(box, &BoxPanel::ready);
  panel.showTab(InspectorPanel::Tab::Box);
  session.setBox(Box{3, -2, 6, -1});
  ASSERT_TRUE(!ready.empty() || ready.wait());
  const QList<QTableWidget*> tables = box->findChildren<QTableWidget*>();
  ASSERT_EQ(tables.size(), 2);
  EXPECT_EQ(tables[0]->rowCount(), 3);  // pixels of 0, 1 and 3 bins
  ASSERT_EQ(tables[1]->rowCount(), 3);
  EXPECT_EQ(tables[1]->item(0, 1)->text(), "66.7 %");
  session.setBox({});
  EXPECT_FALSE(tables[1]->isVisible());
}

TEST_F(Inspector, WhereBAloneIsShownAllIsOfB) {
  QSignalSpy boxReady(box, &BoxPanel::ready), sliceReady(slice, &DepthSlice::ready);
  const auto* state = panel.findChild<QLabel*>("state");
  EXPECT_FALSE(state->text().contains("a.exr"));
  session.setB(threeColours());
  session.setA(oneSample());
  EXPECT_EQ(table->model()->rowCount(), 1);
  EXPECT_TRUE(state->text().contains("A: b.exr")) << state->text().toStdString();
  showAlone(Comparison::B);
  EXPECT_EQ(table->model()->rowCount(), 3);
  EXPECT_TRUE(state->text().contains("B: a.exr")) << state->text().toStdString();
  EXPECT_LT(plot->axis().far, 6);
  panel.showTab(InspectorPanel::Tab::Slice);
  ASSERT_TRUE(!sliceReady.empty() || sliceReady.wait());
  const QImage image = slice->grab().toImage();
  EXPECT_GT(image.pixelColor(slice->placeOf(3.5, 2.3).toPoint()).green(), 200);
  panel.showTab(InspectorPanel::Tab::Box);
  session.setBox(Box{3, -2, 6, -1});
  ASSERT_TRUE(!boxReady.empty() || boxReady.wait());
  EXPECT_EQ(box->findChildren<QTableWidget*>()[1]->rowCount(), 3);
  showAlone(Comparison::A);
  EXPECT_EQ(table->model()->rowCount(), 1);
}

TEST_F(Inspector, ManySamplesAreReadInTheBackgroundAndOnce) {
  session.setA(manySamples());
  EXPECT_EQ(table->model()->rowCount(), 3);
  EXPECT_TRUE(panel.findChild<QLabel*>("state")->text().contains("reading 3000"));
  ASSERT_TRUE(QTest::qWaitFor([this] { return table->model()->rowCount() == 3000; }));
  EXPECT_TRUE(panel.findChild<QLabel*>("state")->text().startsWith("3000 samples"));
  int read = 0;
  QObject::connect(&table->samples(), &QAbstractItemModel::dataChanged,
                   [&](const QModelIndex&, const QModelIndex&, const QList<int>& roles) { read += roles.isEmpty(); });
  ViewState view = session.view();
  view.clip.near = 100;
  session.setView(view);
  QTest::qWait(30);
  EXPECT_EQ(read, 0);
  setExposure(1);
  EXPECT_TRUE(QTest::qWaitFor([&] { return read == 1; }));
}

TEST_F(Inspector, ABoxOfManyBinsListsTheFirst) {
  QSignalSpy ready(box, &BoxPanel::ready);
  panel.showTab(InspectorPanel::Tab::Box);
  session.setBox(Box{3, -2, 6, -1});
  session.setA(manySamples());
  ASSERT_TRUE(QTest::qWaitFor([this] { return box->findChild<QLabel*>()->text().contains("3000"); }));
  EXPECT_EQ(box->findChildren<QTableWidget*>()[1]->rowCount(), 1000);
  EXPECT_TRUE(box->findChild<QLabel*>()->text().contains("first 1000"));
}

TEST_F(Inspector, ABoxThatIsHiddenHoldsNoPicture) {
  QSignalSpy ready(box, &BoxPanel::ready);
  panel.showTab(InspectorPanel::Tab::Box);
  session.setBox(Box{3, -2, 6, -1});
  ASSERT_TRUE(ready.wait());
  panel.showTab(InspectorPanel::Tab::Samples);
  const std::weak_ptr<const Picture> before = session.a();
  session.setA(makePicture("other.exr", before.lock()->deep()->copy()));
  EXPECT_TRUE(QTest::qWaitFor([&] { return before.expired(); }));
}

TEST_F(Inspector, TheMeanOfTheBoxFollowsTheExposure) {
  QSignalSpy ready(box, &BoxPanel::ready);
  panel.showTab(InspectorPanel::Tab::Box);
  session.setBox(Box{3, -2, 6, -1});
  ASSERT_TRUE(!ready.empty() || ready.wait());
  const QString before = box->findChild<QLabel*>()->text();
  setExposure(-2);
  EXPECT_NE(box->findChild<QLabel*>()->text(), before);
}

TEST_F(Inspector, ABoxThatCannotBeReadIsTriedOnce) {
  auto* summary = box->findChild<QLabel*>();
  panel.showTab(InspectorPanel::Tab::Box);
  session.setA(oneSample());  // without G
  session.setBox(Box{3, -2, 6, -1});
  ASSERT_TRUE(QTest::qWaitFor([&] { return summary->text().contains("G"); }));
  summary->setText("as it was");
  setExposure(1);
  QTest::qWait(50);
  EXPECT_EQ(summary->text(), "as it was");
}

TEST_F(Inspector, AFlatPictureHasNoBins) {
  flat::Image image{{0, 0, 9, 9}, {0, 0, 9, 9}, {}, {}};
  for (const char* name : {"A", "B", "G", "R"}) image.add(name, 0.25f);
  session.setBox(Box{0, 0, 4, 4});
  session.setPin(QPoint(4, 4));
  session.setA(makePicture("b.exr", std::move(image)));
  EXPECT_EQ(table->model()->rowCount(), 1);
  panel.showTab(InspectorPanel::Tab::Box);
  EXPECT_TRUE(box->findChild<QLabel*>()->text().contains("no bins"));
  for (const QTableWidget* numbers : box->findChildren<QTableWidget*>()) EXPECT_FALSE(numbers->isVisible());
  panel.showTab(InspectorPanel::Tab::Slice);
  QTest::mouseClick(slice, Qt::LeftButton, {}, slice->rect().center());  // there is no column
  EXPECT_EQ(session.pin(), QPoint(4, 4));
  panel.showTab(InspectorPanel::Tab::Samples);
  QTest::mouseMove(plot, plot->rect().center());  // nor a bar
  EXPECT_FALSE(table->model()->index(0, 0).data(Qt::BackgroundRole).isValid());
}

}  // namespace
}  // namespace fathom::gui
