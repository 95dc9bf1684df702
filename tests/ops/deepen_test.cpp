// Flat to deep: nothing is lost, and each odd depth has its answer.
#include "deep/ops/deepen.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/error.h"
#include "deep/flatten.h"

namespace fathom::deep {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

flat::Image randomFlat(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  flat::Image image{{-2, 3, 7, 9}, {0, 0, 16, 16}, {}, {{"fathom:note", "kept"}}};
  for (const char* name : {"R", "G", "B", "A", "Z", "specular.R", "depth.V"}) image.add(name);
  for (size_t i = 0; i < image.dataWindow.area(); ++i) {
    const bool empty = random() % 4 == 0;
    for (flat::Plane& plane : image.planes) plane.values[i] = empty ? 0 : unit(random);
    image.find("depth.V")->values[i] = 10 * unit(random);
  }
  return image;
}

TEST(Deepen, FlattensToTheImageAgain) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const flat::Image image = randomFlat(seed);
    for (const DeepenParams& params :
         {DeepenParams{}, DeepenParams{.z = 3.5f}, DeepenParams{.depthChannel = "depth.V", .thickness = 2}}) {
      const DeepImage deep = deepen(image, params);
      const flat::Image flat = flatten(deep);
      EXPECT_EQ(flat.dataWindow, image.dataWindow);
      EXPECT_EQ(flat.displayWindow, image.displayWindow);
      EXPECT_EQ(flat.attributes.at("fathom:note"), "kept");
      for (const char* name : {"R", "G", "B", "A", "specular.R"})
        for (size_t i = 0; i < image.dataWindow.area(); ++i)
          ASSERT_EQ(flat.get(name).values[i], image.get(name).values[i]) << name << ", seed " << seed;
    }
  }
}

TEST(Deepen, DepthsAreWhereTheyWereAskedFor) {
  const flat::Image image = randomFlat(3);
  const DeepImage own = deepen(image, {}), constant = deepen(image, {.z = 3.5f, .thickness = 2});
  const DeepImage other = deepen(image, {.depthChannel = "depth.V"});
  EXPECT_FALSE(own.find("ZBack"));
  EXPECT_FALSE(other.find("depth.V"));
  for (size_t p = 0; p < own.pixels(); ++p) {
    const bool empty = image.get("A").values[p] == 0;
    ASSERT_EQ(own.count(p), empty ? 0u : 1u);
    if (empty) continue;
    EXPECT_EQ(own.get("Z")[own.offsets[p]], image.get("Z").values[p]);
    EXPECT_EQ(other.get("Z")[own.offsets[p]], image.get("depth.V").values[p]);
    EXPECT_EQ(constant.get("Z")[own.offsets[p]], 3.5f);
    EXPECT_EQ(constant.get("ZBack")[own.offsets[p]], 5.5f);
  }
}

flat::Image onePixel(float r, float a, float z) {
  flat::Image image{{0, 0, 1, 1}, {0, 0, 1, 1}, {}, {}};
  image.add("R", r);
  image.add("A", a);
  image.add("Z", z);
  return image;
}

TEST(Deepen, OddPixels) {
  EXPECT_EQ(deepen(onePixel(1, 1, kNan), {}).samples(), 0u);
  EXPECT_EQ(deepen(onePixel(1, 1, kNan), {.z = 2.0f}).samples(), 1u);
  EXPECT_EQ(deepen(onePixel(1, 1, kInfinity), {.thickness = 1}).samples(), 1u);
  EXPECT_EQ(deepen(onePixel(0, 0, 5), {}).samples(), 0u);
  EXPECT_EQ(deepen(onePixel(kNan, kNan, 5), {}).samples(), 0u);
  EXPECT_EQ(deepen(onePixel(0.5f, 0, 5), {}).samples(), 1u);  // emission
  flat::Image noAlpha = onePixel(0.5f, 0, 5), noDepth = onePixel(1, 1, 1);
  std::erase_if(noAlpha.planes, [](const flat::Plane& plane) { return plane.name == "A"; });
  EXPECT_EQ(deepen(noAlpha, {}).get("A")[0], 1);
  std::erase_if(noDepth.planes, [](const flat::Plane& plane) { return plane.name == "Z"; });
  EXPECT_THROW(deepen(noDepth, {}), Error);
  EXPECT_EQ(deepen(noDepth, {.z = 1.0f}).samples(), 1u);
  EXPECT_EQ(deepen(flat::Image{{}, {}, {}, {}}, {.z = 1.0f}).samples(), 0u);
}

TEST(Deepen, ExtinctionBecomesAlpha) {
  const DeepImage deep = deepen(onePixel(0.6f, 1.5f, 3), {.thickness = 2, .extinction = true});
  EXPECT_FLOAT_EQ(deep.get("A")[0], float(1 - std::exp(-3.0)));
  EXPECT_FLOAT_EQ(deep.get("R")[0], float(0.4 * (1 - std::exp(-3.0))));
  const DeepImage thin = deepen(onePixel(0.6f, 1e-20f, 3), {.thickness = 2, .extinction = true});
  EXPECT_FLOAT_EQ(thin.get("A")[0], 2e-20f);
  EXPECT_FLOAT_EQ(thin.get("R")[0], 1.2f);
  const DeepImage fire = deepen(onePixel(0.6f, 0, 3), {.thickness = 2, .extinction = true});
  EXPECT_EQ(fire.get("A")[0], 0);
  EXPECT_FLOAT_EQ(fire.get("R")[0], 1.2f);
  EXPECT_EQ(deepen(onePixel(0.6f, kInfinity, 3), {.thickness = 2, .extinction = true}).get("A")[0], 0);
  EXPECT_THROW(deepen(onePixel(1, 1, 1), {.extinction = true}), Error);
}

TEST(Deepen, CarriesTheCamera) {
  flat::Image image = onePixel(1, 1, 1);
  image.attributes = {
      {"worldtocamera", "1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5.0, 6.0, 7.0, 1.0"},
      {"PixelAspectRatio", "2.0"},
      {"displayWindow", "odd"},
      {"frame", "12"}};
  const DeepImage deep = deepen(image, {});
  ASSERT_TRUE(deep.attributes.getMatrix("worldToCamera"));
  EXPECT_EQ((*deep.attributes.getMatrix("worldToCamera"))[13], 6);
  EXPECT_EQ(deep.attributes.getFloat("pixelAspectRatio"), 2.0f);
  EXPECT_EQ(deep.attributes.getInt("frame"), 12);
  EXPECT_FALSE(deep.attributes.getString("displayWindow"));
}

}  // namespace
}  // namespace fathom::deep
