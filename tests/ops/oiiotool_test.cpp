// Deep compositing against oiiotool: the same answers where it is right, and the equation of transfer's where it is not.
#include <gtest/gtest.h>

#include <cstdlib>

#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/ops/holdout.h"
#include "deep/ops/merge.h"
#include "flat/io.h"
#include "tests/reference/radiative.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::deep {
namespace {

using reference::integrate;
using reference::mediaOf;
using reference::randomSamples;
using reference::together;

class Oiiotool : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v oiiotool >/dev/null") != 0) GTEST_SKIP() << "oiiotool is not installed";
  }

  std::string store(const std::string& name, const DeepImage& image) const {
    deep::write(folder_ / name, image);
    return folder_ / name;
  }
  // What `oiiotool ARGUMENTS -o out.exr` leaves; empty where it fails.
  std::string run(const std::string& arguments) const {
    const std::string out = folder_ / "out.exr";
    std::filesystem::remove(out);
    const int status = std::system(("oiiotool " + arguments + " -o " + out + " >/dev/null 2>&1").c_str());
    return status == 0 ? out : "";
  }

  TemporaryFolder folder_;
};

// Points in front of one another, as a renderer without volumes writes them; no identifiers, which oiiotool composites.
DeepImage points(unsigned seed) {
  DeepImage image = randomSamples({.window = {0, 0, 9, 7}, .seed = seed});
  image.erase("id");
  return image;
}

DeepImage volumes(unsigned seed) {
  DeepImage image = randomSamples({.window = {0, 0, 9, 7}, .seed = seed, .volumes = true, .sorted = false});
  image.erase("id");
  return image;
}

double largestDifference(const flat::Image& a, const flat::Image& b, const char* channel) {
  double most = 0;
  const auto &x = a.get(channel).values, &y = b.get(channel).values;
  for (size_t i = 0; i < x.size(); ++i) most = std::max(most, double(std::abs(x[i] - y[i])));
  return most;
}

TEST_F(Oiiotool, FlattensPointsAsWeDo) {
  for (unsigned seed = 1; seed <= 2; ++seed) {
    const DeepImage image = points(seed);
    const flat::Image theirs = flat::read(run(store("a.exr", image) + " --flatten")), ours = flatten(image);
    for (const char* channel : {"R", "G", "B", "A"}) EXPECT_LT(largestDifference(ours, theirs, channel), 1e-5) << seed;
  }
}

// It removes what is hidden behind opaque samples, too: here there are none.
TEST_F(Oiiotool, MergesPointsAsWeDo) {
  for (unsigned seed = 1; seed <= 2; ++seed) {
    std::vector<DeepImage> inputs;
    inputs.push_back(points(seed));
    inputs.push_back(points(100 + seed));
    for (DeepImage& input : inputs)
      for (float& alpha : input.get("A")) alpha = std::min(alpha, 0.9f);
    const std::string files = store("a.exr", inputs[0]) + " " + store("b.exr", inputs[1]);
    const DeepImage theirs = deep::read(run(files + " --deepmerge")), ours = merge(inputs);
    ASSERT_EQ(ours.samples(), theirs.samples()) << seed;
    for (const char* channel : {"R", "G", "B", "A", "Z"})
      for (size_t s = 0; s < ours.samples(); ++s)
        ASSERT_FLOAT_EQ(ours.get(channel)[s], theirs.get(channel)[s]) << channel << ", seed " << seed;
  }
}

// It removes what lies behind the first opaque sample.
TEST_F(Oiiotool, HoldsOutBehindWhatIsOpaqueAsWeDo) {
  for (unsigned seed = 1; seed <= 2; ++seed) {
    const DeepImage image = points(seed);
    DeepImage wall = points(100 + seed);
    for (float& alpha : wall.get("A")) alpha = 1;
    const std::string files = store("a.exr", image) + " " + store("b.exr", wall);
    const flat::Image theirs = flatten(deep::read(run(files + " --deepholdout"))),
                      ours = flatten(holdout(image.copy(), wall));
    for (const char* channel : {"R", "G", "B", "A"}) EXPECT_LT(largestDifference(ours, theirs, channel), 1e-5) << seed;
  }
}

TEST_F(Oiiotool, IsWrongWhereVolumesOverlapAndWeAreNot) {
  const DeepImage image = volumes(1);
  const flat::Image theirs = flat::read(run(store("a.exr", image) + " --flatten")), ours = flatten(image);
  double oursOff = 0, theirsOff = 0;
  for (size_t p = 0; p < image.pixels(); ++p) {
    const double right = integrate(mediaOf(image, p)).totalLight();
    oursOff = std::max(oursOff, std::abs(right - double(ours.get("R").values[p])));
    theirsOff = std::max(theirsOff, std::abs(right - double(theirs.get("R").values[p])));
  }
  EXPECT_LT(oursOff, 1e-5);
  EXPECT_GT(theirsOff, 1e-2);
}

TEST_F(Oiiotool, IgnoresAlphaThatAddsUpInAHoldoutAndWeDoNot) {
  const DeepImage image = points(1), veil = points(2);
  const std::string files = store("a.exr", image) + " " + store("b.exr", veil);
  const flat::Image theirs = flatten(deep::read(run(files + " --deepholdout"))),
                    ours = flatten(holdout(image.copy(), veil));
  double oursOff = 0, theirsOff = 0;
  for (size_t p = 0; p < image.pixels(); ++p) {
    const double right = integrate(together(mediaOf(image, p, "R", 0), mediaOf(veil, p, "R", 1)), 2).light[0];
    oursOff = std::max(oursOff, std::abs(right - double(ours.get("R").values[p])));
    theirsOff = std::max(theirsOff, std::abs(right - double(theirs.get("R").values[p])));
  }
  EXPECT_LT(oursOff, 1e-5);
  EXPECT_GT(theirsOff, 1e-2);
}

TEST_F(Oiiotool, DoesNotResizeDeepImages) {
  EXPECT_EQ(run(store("a.exr", points(1)) + " --resize 4x3"), "");
}

}  // namespace
}  // namespace fathom::deep
