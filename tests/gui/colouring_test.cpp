// Known values through the display transform, and what stands for all that is no colour.
#include "gui/colouring.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QFile>
#include <QTemporaryDir>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "flat/colour_scale.h"
#include "flat/tonemap.h"

namespace fathom::gui {
namespace {

using ::testing::ElementsAre;

Seen makeSeen(Layer::Kind kind, const std::vector<std::vector<float>>& channels, const std::vector<float>& alpha = {}) {
  Seen seen{{"layer", {}, kind}, {0, 0, int(channels[0].size()), 1}, 1, int(channels[0].size()), 1};
  for (const auto& values : channels) {
    seen.values.emplace_back(values.size());
    std::ranges::copy(values, seen.values.back().data());
  }
  if (!alpha.empty()) {
    seen.alpha = Buffer<float>(alpha.size());
    std::ranges::copy(alpha, seen.alpha.data());
  }
  return seen;
}

// Grey of these values.
Seen makeGrey(const std::vector<float>& values) {
  return makeSeen(Layer::Kind::Colour, {values, values, values});
}

QImage colourOf(const Seen& seen, const ViewState& state = {}) {
  static const Display display;
  return colour(seen, state, {}, display);
}

TEST(Display, OffersWhatTheConfigHas) {
  const Display display;
  EXPECT_THAT(display.displays(), ElementsAre("sRGB", "Rec.1886"));
  EXPECT_THAT(display.views("Rec.1886"), ElementsAre("Standard", "Linear", "Raw"));
  EXPECT_TRUE(display.looks().empty());
}

TEST(Display, KnownValuesThroughSrgb) {
  const std::vector<float> values = {0, 0.001f, 0.18f, 0.5f, 1, 4, -1};
  const QImage image = colourOf(makeGrey(values));
  for (size_t i = 0; i < values.size(); ++i)
    EXPECT_NEAR(qRed(image.pixel(int(i), 0)), 255 * flat::srgb(values[i]), 1) << values[i];
  EXPECT_EQ(qRed(image.pixel(2, 0)), 118);
}

TEST(Display, DisplayViewExposureAndGamma) {
  ViewState state;
  state.display.display = "Rec.1886";
  EXPECT_NEAR(qRed(colourOf(makeGrey({0.18f}), state).pixel(0, 0)), 255 * std::pow(0.18, 1 / 2.4), 1);
  state.display.view = "Raw";
  EXPECT_NEAR(qRed(colourOf(makeGrey({0.18f}), state).pixel(0, 0)), 255 * 0.18, 1);
  state.display.exposure = 2;
  EXPECT_NEAR(qRed(colourOf(makeGrey({0.18f}), state).pixel(0, 0)), 255 * 0.72, 1);
  state.display.gamma = 2;
  EXPECT_NEAR(qRed(colourOf(makeGrey({0.18f}), state).pixel(0, 0)), 255 * std::sqrt(0.72), 1);
}

TEST(Display, RowsOfAnyLengthAndOrderOfChannels) {
  for (int width = 1; width < 40; ++width) {
    const std::vector<float> red(size_t(width), 1.0f), none(size_t(width), 0.0f);
    const QImage image = colourOf(makeSeen(Layer::Kind::Colour, {red, none, none}));
    for (int x = 0; x < width; ++x) ASSERT_EQ(image.pixel(x, 0), qRgb(255, 0, 0)) << width << ", " << x;
  }
}

DisplayParams paramsOf(const std::string& display, const std::string& view, float gamma = 1) {
  DisplayParams params;
  params.display = display;
  params.view = view;
  params.gamma = gamma;
  return params;
}

// Bytes of values that climb through all that a screen shows, and of extremes.
void expectSameRows(const Display& display, const DisplayParams& params) {
  std::vector<float> values = {0, -0.0f, 1e-30f, -1e-6f, -0.1f, -65504, 65504, 1};
  for (float value = 1e-7f; value < 20; value *= 1.0003f) values.push_back(value);
  const std::vector<float> reversed(values.rbegin(), values.rend());
  const std::array<const float*, 3> rgb{values.data(), reversed.data(), values.data()};
  std::vector<QRgb> quick(values.size()), exact(values.size());
  display.transform(params)(rgb, int(values.size()), quick.data());
  display.transform(params, true)(rgb, int(values.size()), exact.data());
  size_t others = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    ASSERT_NEAR(qRed(quick[i]), qRed(exact[i]), 1) << values[i];
    ASSERT_NEAR(qGreen(quick[i]), qGreen(exact[i]), 1) << reversed[i];
    ASSERT_EQ(qAlpha(quick[i]), 255);
    others += quick[i] != exact[i];
  }
  EXPECT_LT(others, values.size() / 50) << params.display << ", " << params.view << ", " << params.gamma;
}

TEST(Display, TheTableShowsWhatOpenColorIoDoes) {
  const Display display;
  for (const std::string& name : display.displays())
    for (const std::string& view : display.views(name))
      for (const float gamma : {0.5f, 1.0f, 2.2f}) expectSameRows(display, paramsOf(name, view, gamma));
}

TEST(Display, WhatNoTableHoldsIsStillRight) {
  QTemporaryDir folder;
  const QString path = folder.filePath("mixing.ocio");
  QFile file(path);
  ASSERT_TRUE(file.open(QIODevice::WriteOnly));
  // The first view mixes channels, the second one is too steep near 0.
  file.write(R"(ocio_profile_version: 2
roles: {default: linear, scene_linear: linear}
displays:
  screen:
    - !<View> {name: mixing, colorspace: mixed}
    - !<View> {name: steep, colorspace: steep}
colorspaces:
  - !<ColorSpace> {name: linear}
  - !<ColorSpace>
    name: mixed
    from_scene_reference: !<MatrixTransform> {matrix: [0.5, 0.5, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}
  - !<ColorSpace>
    name: steep
    from_scene_reference: !<ExponentTransform> {value: [0.02, 0.02, 0.02, 1]}
)");
  file.close();
  const Display display(path.toStdString());
  expectSameRows(display, paramsOf("", "mixing"));
  expectSameRows(display, paramsOf("", "steep"));
  const float red = 1, none = 0;
  QRgb pixel;
  display.transform(paramsOf("", "mixing"))({&red, &none, &none}, 1, &pixel);
  EXPECT_EQ(qRed(pixel), 128);
}

TEST(Display, AConfigThatCannotBeUsedIsNamedAndReplaced) {
  EXPECT_THROW(Display("/nothing/config.ocio"), Error);
  QTemporaryDir folder;
  const QString path = folder.filePath("broken.ocio");
  QFile file(path);
  ASSERT_TRUE(file.open(QIODevice::WriteOnly));
  file.write("ocio_profile_version: 2\nroles: {scene_linear: missing}\n");
  file.close();
  qputenv("OCIO", path.toUtf8());
  std::string problem;
  const auto display = Display::open(problem);
  qunsetenv("OCIO");
  EXPECT_THAT(problem, ::testing::StartsWith(path.toStdString()));
  EXPECT_EQ(display->displays()[0], "sRGB");
}

TEST(Display, LooksOfAConfig) {
  QTemporaryDir folder;
  const QString path = folder.filePath("looks.ocio");
  QFile file(path);
  ASSERT_TRUE(file.open(QIODevice::WriteOnly));
  file.write(R"(ocio_profile_version: 2
roles: {default: linear, scene_linear: linear}
displays:
  screen:
    - !<View> {name: plain, colorspace: linear}
looks:
  - !<Look> {name: half, process_space: linear, transform: !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}}
colorspaces:
  - !<ColorSpace> {name: linear}
)");
  file.close();
  const Display display(path.toStdString());
  EXPECT_THAT(display.looks(), ElementsAre("half"));
  ViewState state;
  EXPECT_EQ(qRed(colour(makeGrey({0.6f}), state, {}, display).pixel(0, 0)), 153);
  state.display.look = "half";
  EXPECT_NEAR(qRed(colour(makeGrey({0.6f}), state, {}, display).pixel(0, 0)), 76.5, 1);
}

TEST(Colouring, OneChannelAlone) {
  const Seen seen = makeSeen(Layer::Kind::Colour, {{0.1f}, {0.4f}, {0.9f}}, {0.5f});
  const auto shown = [&](Isolate isolate) {
    ViewState state;
    state.isolate = isolate;
    const QRgb pixel = colourOf(seen, state).pixel(0, 0);
    EXPECT_EQ(qRed(pixel), qBlue(pixel));
    EXPECT_EQ(qRed(pixel), qGreen(pixel));
    return qRed(pixel);
  };
  EXPECT_NEAR(shown(Isolate::Red), 255 * flat::srgb(0.1), 1);
  EXPECT_NEAR(shown(Isolate::Green), 255 * flat::srgb(0.4), 1);
  EXPECT_NEAR(shown(Isolate::Blue), 255 * flat::srgb(0.9), 1);
  EXPECT_NEAR(shown(Isolate::Luminance), 255 * flat::srgb(0.2126 * 0.1 + 0.7152 * 0.4 + 0.0722 * 0.9), 1);
  EXPECT_NEAR(shown(Isolate::Alpha), 127.5, 1);  // no light: no curve
}

TEST(Colouring, WhatIsNoNumberAndWhatIsClippedIsMarked) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
  const Seen seen = makeGrey({kNan, -kInfinity, 0.6f, -0.1f, 0.1f});
  ViewState state;
  QImage image = colourOf(seen, state);
  EXPECT_EQ(image.pixel(0, 0), kMarkNan);
  EXPECT_EQ(image.pixel(1, 0), kMarkNan);
  EXPECT_EQ(qRed(image.pixel(3, 0)), 0);
  state.display.markNan = false;
  state.display.markClipped = true;
  state.display.exposure = 1;
  image = colourOf(seen, state);
  EXPECT_NE(image.pixel(0, 0), kMarkNan);
  EXPECT_EQ(image.pixel(2, 0), kMarkAbove);
  EXPECT_EQ(image.pixel(3, 0), kMarkBelow);
  EXPECT_NEAR(qRed(image.pixel(4, 0)), 255 * flat::srgb(0.2), 1);
}

TEST(Colouring, VectorsAreHalvesAroundGreyWhereTheyCover) {
  const QImage image = colourOf(makeSeen(Layer::Kind::Vector, {{1, 0}, {-1, 0}, {0, 0}}, {1, 0}));
  EXPECT_EQ(image.pixel(0, 0), qRgb(255, 0, 128));
  EXPECT_EQ(image.pixel(1, 0), qRgb(0, 0, 0));
}

TEST(Colouring, DepthsRunFromLightToDarkBetweenTheEnds) {
  const Seen seen = makeSeen(Layer::Kind::Depth, {{2, 6, 100, 3}}, {1, 1, 1, 0});
  ViewState state;
  state.display.low = 2;
  state.display.high = 6;
  const QImage image = colourOf(seen, state);
  EXPECT_GT(qGray(image.pixel(0, 0)), 200);
  EXPECT_LT(qGray(image.pixel(1, 0)), 50);
  EXPECT_EQ(image.pixel(1, 0), image.pixel(2, 0));  // behind the end
  EXPECT_EQ(image.pixel(3, 0), qRgb(0, 0, 0));      // nothing there
}

TEST(Colouring, TheEndsOfAPictureLeaveOutliersOut) {
  std::vector<float> values(1000, 5.0f);
  for (size_t i = 0; i < 1000; ++i) values[i] = 1 + float(i) / 1000;
  values[7] = 1e9f;
  values[8] = std::numeric_limits<float>::quiet_NaN();
  const ValueRange depth = rangeOf(makeSeen(Layer::Kind::Depth, {values}));
  EXPECT_NEAR(depth.low, 1, 0.02);
  EXPECT_NEAR(depth.high, 2, 0.02);
  const ValueRange scalar = rangeOf(makeSeen(Layer::Kind::Scalar, {values}));
  EXPECT_EQ(scalar.low, 0);
  EXPECT_NEAR(scalar.high, 2, 0.02);
}

TEST(Colouring, GreyIsLightWhateverIsIsolated) {
  const Seen grey = makeSeen(Layer::Kind::Colour, {{0.18f, 1}}, {0.5f, 1});
  for (const Isolate isolate : {Isolate::All, Isolate::Red, Isolate::Blue, Isolate::Luminance}) {
    ViewState state;
    state.isolate = isolate;
    const QImage image = colourOf(grey, state);
    EXPECT_NEAR(qRed(image.pixel(0, 0)), 118, 1);
    EXPECT_EQ(image.pixel(1, 0), qRgb(255, 255, 255));
    EXPECT_EQ(differenceOf(grey, grey, isolate).values[0][0], 0);
    EXPECT_EQ(relativeErrorOf(grey, grey, isolate).values[0][1], 0);
  }
}

TEST(Colouring, DifferencesHaveASignAndErrorsDoNot) {
  const Seen a = makeSeen(Layer::Kind::Colour, {{0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f}});
  const Seen b = makeSeen(Layer::Kind::Colour, {{0.5f, 0.4f, 0.6f}, {0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f}});
  const auto showDifference = [&](const ViewState& state) {
    return colourDifference(differenceOf(a, b, state.isolate), state);
  };
  const QImage difference = showDifference({});
  EXPECT_LT(qGray(difference.pixel(0, 0)), 3);
  EXPECT_GT(qRed(difference.pixel(1, 0)), qBlue(difference.pixel(1, 0)));  // A is more
  EXPECT_LT(qRed(difference.pixel(2, 0)), qBlue(difference.pixel(2, 0)));
  ViewState green;
  green.isolate = Isolate::Green;
  EXPECT_LT(qGray(showDifference(green).pixel(1, 0)), 3);
  const QImage error = colourRelativeError(relativeErrorOf(a, b, Isolate::All), {});
  EXPECT_EQ(error.pixel(0, 0), qRgb(0, 0, 0));
  EXPECT_GT(qGray(error.pixel(1, 0)), 60);
  EXPECT_THROW(differenceOf(a, makeSeen(Layer::Kind::Depth, {{1, 2, 3}}), Isolate::All), Error);
}

TEST(FalseColours, SayWhatTheyMean) {
  ViewState state;
  const Layer depth{"Z", {"Z"}, Layer::Kind::Depth};
  FalseColours colours = falseColours(depth, state, Comparison::A, {2, 6});
  ASSERT_EQ(colours.ticks.size(), 3u);
  EXPECT_EQ(colours.ticks[1], std::pair(0.5, QString("4")));
  state.display.low = 1;
  state.display.high = 3;
  EXPECT_EQ(falseColours(depth, state, Comparison::A, {2, 6}).ticks[2].second, "3");
  state.display.exposure = 1;
  colours = falseColours(depth, state, Comparison::RelativeError, {});
  EXPECT_EQ(colours.ticks.front(), std::pair(0.0, QString("0.5 %")));
  EXPECT_NEAR(colours.ticks.back().first, 1, 1e-6);
  EXPECT_TRUE(falseColours({"RGBA", {"R"}, Layer::Kind::Colour}, state, Comparison::A, {}).scale.empty());
}

}  // namespace
}  // namespace fathom::gui
