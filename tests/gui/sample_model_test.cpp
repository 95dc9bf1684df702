// The table of a pixel's samples without a window: values, ids, order, and what is copied.
#include "gui/sample_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QProcess>
#include <QTemporaryDir>
#include <clocale>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "deep/ops/sample.h"
#include "tests/reference/deep_samples.h"

namespace fathom::gui {
namespace {

using reference::makeDeep;
using ::testing::ElementsAre;
using Samples = std::vector<reference::Sample>;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
const QPoint kPixel{3, -2};  // the first one of makeDeep

const Samples kThree{{1, 1, 0.25f, 0.5f, 0xffffffff}, {2, 3, 0.5f, 0.1f, 7}, {5, 5, 1, 0.75f, 0}};

PicturePtr picture(const Samples& samples) {
  return makePicture("a.exr", makeDeep({samples, {{4, 4, 0.5f}}, {}}, 3));
}

void show(SampleModel& model, const Samples& samples) {
  model.show(samplesAt(picture(samples), kPixel, "RGBA", 0));
}

int column(const SampleModel& model, const QString& name) {
  for (int i = 0; i < model.columnCount(); ++i)
    if (model.columnName(i) == name) return i;
  fail("no column {}", name.toStdString());
}

QString text(const QAbstractItemModel& model, int row, int column) {
  return model.index(row, column).data().toString();
}

std::vector<QString> columnTexts(const QAbstractItemModel& model, int column) {
  std::vector<QString> result;
  for (int row = 0; row < model.rowCount(); ++row) result.push_back(text(model, row, column));
  return result;
}

TEST(SampleModel, ShowsTheSamplesAsStored) {
  SampleModel model;
  show(model, kThree);
  ASSERT_EQ(model.rowCount(), 3);
  EXPECT_THAT(columnTexts(model, column(model, "#")), ElementsAre("0", "1", "2"));
  EXPECT_THAT(columnTexts(model, column(model, "Z")), ElementsAre("1", "2", "5"));
  EXPECT_THAT(columnTexts(model, column(model, "ZBack")), ElementsAre("1", "3", "5"));
  EXPECT_THAT(columnTexts(model, column(model, "A")), ElementsAre("0.25", "0.5", "1"));
  EXPECT_THAT(columnTexts(model, column(model, "seen")), ElementsAre("0.25", "0.375", "0.375"));
  EXPECT_THAT(columnTexts(model, column(model, "front")), ElementsAre("1", "0.75", "0.375"));
  EXPECT_THAT(columnTexts(model, column(model, "id")), ElementsAre("4294967295", "7", "0"));
}

TEST(SampleModel, FollowsFromPixelToPixel) {
  const PicturePtr of = picture(kThree);
  SampleModel model;
  model.show(samplesAt(of, kPixel, "RGBA", 0));
  int resets = 0;
  QObject::connect(&model, &QAbstractItemModel::modelReset, [&] { ++resets; });
  for (const auto& [x, rows, depth] : {std::tuple{4, 1, "4"}, {5, 0, ""}, {3, 3, "1"}, {2, 0, ""}, {4, 1, "4"}}) {
    model.show(samplesAt(of, {x, -2}, "RGBA", 0));
    EXPECT_EQ(model.rowCount(), rows);
    if (rows > 0) {
      EXPECT_EQ(text(model, 0, column(model, "Z")), depth);
    }
  }
  EXPECT_EQ(resets, 0);
}

TEST(SampleModel, SortsByValueAndNoNumbersLast) {
  SampleModel model;
  SampleOrder order;
  order.setSourceModel(&model);
  show(model, {{10, 10, 0.1f}, {NAN, 1, 0.1f}, {-kInfinity, 2, 0.1f}, {9, 9, 0.1f}, {kInfinity, 3, 0.1f}, {-2, -2, 0}});
  const int z = column(model, "Z");
  order.sort(z);
  EXPECT_THAT(columnTexts(order, z), ElementsAre("-inf", "-2", "9", "10", "inf", "nan"));
  order.sort(z, Qt::DescendingOrder);
  EXPECT_THAT(columnTexts(order, z), ElementsAre("nan", "inf", "10", "9", "-2", "-inf"));
  order.sort(-1);
  EXPECT_EQ(text(order, 0, z), "10");
}

TEST(SampleModel, NeighbouringIdsAreNotTheSame) {
  SampleModel model;
  SampleOrder order;
  order.setSourceModel(&model);
  show(model, {{1, 1, 0, 0, 4294967295u}, {1, 1, 0, 0, 4294967294u}, {1, 1, 0, 0, 16777217}, {1, 1, 0, 0, 16777216}});
  const int id = column(model, "id");
  order.sort(id);
  EXPECT_THAT(columnTexts(order, id), ElementsAre("16777216", "16777217", "4294967294", "4294967295"));
}

TEST(SampleModel, GreysWhatIsClippedAway) {
  SampleModel model;
  show(model, kThree);
  const auto greyed = [&](const deep::DepthRange& clip) {
    model.setClip(clip);
    QString result;
    for (int row = 0; row < 3; ++row) result += model.index(row, 0).data(Qt::ForegroundRole).isValid() ? '-' : '+';
    return result.toStdString();
  };
  EXPECT_EQ(greyed({}), "+++");
  EXPECT_EQ(greyed({.near = 1, .far = 5}), "++-");
  EXPECT_EQ(greyed({.near = 2.5f, .far = 6}), "-++");  // half of the volume
  EXPECT_EQ(greyed({.near = 3}), "--+");               // none of it
  EXPECT_EQ(greyed({.near = 1, .far = 2.5f, .inverted = true}), "-++");
  EXPECT_EQ(greyed({.near = 2, .far = 3, .inverted = true}), "+-+");
  EXPECT_EQ(greyed({.near = 1, .far = 7, .soft = 1}), "-++");  // where the fade begins nothing is left
  EXPECT_EQ(greyed({.near = 0.5f, .far = 6, .soft = 1, .inverted = true}), "+--");  // what fades is on both sides
}

TEST(SampleModel, ColoursAreNotPremultiplied) {
  SampleModel model;
  deep::DeepImage image = makeDeep({{{1, 1, 0.5f, 0.25f}}}, 1);
  image.add("G", deep::PixelType::Float).values[0] = 0;
  model.show(samplesAt(makePicture("a.exr", std::move(image)), kPixel, "RGBA", 0));
  const QColor colour = model.index(0, column(model, "colour")).data(Qt::DecorationRole).value<QColor>();
  EXPECT_EQ(colour.red(), 188);  // sRGB of 0.5
  EXPECT_EQ(colour.green(), 0);
  EXPECT_EQ(colour.blue(), 255);
}

TEST(SampleModel, TsvHoldsTheBits) {
  const float third = 1.0f / 3, tiny = 1e-30f;
  SampleModel model;
  show(model, {{third, third, 0.1f, tiny, 4294967295u}, {NAN, kInfinity, 1, 0.2f, 3}});
  std::vector<int> columns;
  for (const char* name : {"id", "Z", "R", "ZBack"}) columns.push_back(column(model, name));
  const QStringList lines = model.tsv({1, 0}, columns).split('\n');
  ASSERT_EQ(lines.size(), 4);
  EXPECT_EQ(lines[0], "id\tZ\tR\tZBack");
  EXPECT_EQ(lines[1], "3\tnan\t0.2\tinf");
  const QStringList cells = lines[2].split('\t');
  EXPECT_EQ(cells[0], "4294967295");
  EXPECT_EQ(cells[1].toFloat(), third);
  EXPECT_EQ(cells[2].toFloat(), tiny);
  EXPECT_EQ(lines[3], "");
}

TEST(SampleModel, JsonHoldsTheChosenSamples) {
  SampleModel model;
  show(model, kThree);
  const auto json = nlohmann::json::parse(model.json({2, 0}).toStdString());
  EXPECT_EQ(json["x"], 3);
  EXPECT_EQ(json["y"], -2);
  ASSERT_EQ(json["samples"].size(), 2u);
  EXPECT_EQ(json["samples"][0]["channels"]["Z"], 5);
  EXPECT_EQ(json["samples"][1]["channels"]["id"], 4294967295u);
  EXPECT_EQ(json["samples"][1]["seen"], 0.25);
}

// A locale that writes numbers with a comma, whatever is installed: glibc's tool makes one of the sources of locales.
class CommaLocale {
 public:
  CommaLocale() : before_(std::setlocale(LC_NUMERIC, nullptr)) {
    for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8"})
      if (std::setlocale(LC_NUMERIC, name)) return;
    const QString made = folder_.filePath("de_DE.UTF-8");
    QProcess::execute("localedef", {"-c", "-i", "de_DE", "-f", "UTF-8", made});
    qputenv("LOCPATH", folder_.path().toUtf8());
    std::setlocale(LC_NUMERIC, "de_DE.UTF-8");
    qunsetenv("LOCPATH");
  }
  ~CommaLocale() { std::setlocale(LC_NUMERIC, before_.c_str()); }
  bool isThere() const { return *std::localeconv()->decimal_point == ','; }

 private:
  std::string before_;
  QTemporaryDir folder_;
};

// As QApplication chooses the locale of the user.
TEST(SampleModel, JsonDoesNotFollowTheLocale) {
  std::string text;
  {
    const CommaLocale locale;
    if (!locale.isThere()) GTEST_SKIP() << "no German or French locale, and none could be made";
    SampleModel model;
    show(model, kThree);
    text = model.json({0}).toStdString();
  }
  EXPECT_EQ(nlohmann::json::parse(text)["samples"][0]["channels"]["A"], 0.25);
}

TEST(SampleModel, JsonTakesNamesThatAreNotUtf8) {
  deep::DeepImage image = makeDeep({kThree}, 1);
  image.add("caf\xe9", deep::PixelType::Float).values.fill(0.5f);
  SampleModel model;
  model.show(samplesAt(makePicture("a.exr", std::move(image)), kPixel, "RGBA", 0));
  const auto json = nlohmann::json::parse(model.json({0}).toStdString());
  EXPECT_EQ(json["samples"][0]["channels"]["caf\ufffd"], 0.5);
}

TEST(SampleModel, AFlatPixelIsOneRow) {
  flat::Image image{{0, 0, 2, 1}, {0, 0, 2, 1}, {}, {}};
  for (const char* name : {"A", "B", "G", "R", "depth"}) image.add(name, 0.25f);
  image.find("depth")->values[1] = 12.5f;
  SampleModel model;
  model.show(samplesAt(makePicture("a.exr", std::move(image)), {1, 0}, "RGBA", 0));
  ASSERT_EQ(model.rowCount(), 1);
  EXPECT_EQ(text(model, 0, column(model, "depth")), "12.5");
  EXPECT_THROW(column(model, "seen"), Error);
  const auto json = nlohmann::json::parse(model.json({0}).toStdString());
  EXPECT_EQ(json["channels"]["depth"], 12.5);
  EXPECT_EQ(json["channels"]["A"], 0.25);
}

TEST(SampleModel, WithoutAlphaItSaysWhy) {
  deep::DeepImage image = makeDeep({kThree}, 1);
  image.erase("A");
  SampleModel model;
  model.show(samplesAt(makePicture("a.exr", std::move(image)), kPixel, "RGBA", 0));
  EXPECT_EQ(model.rowCount(), 3);
  EXPECT_EQ(text(model, 1, column(model, "Z")), "2");
  EXPECT_EQ(text(model, 1, column(model, "seen")), "");
  EXPECT_TRUE(model.samples().problem.contains("A"));
  EXPECT_THROW(model.json({0}), Error);
}

}  // namespace
}  // namespace fathom::gui
