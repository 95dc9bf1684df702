// Tidy, flatten and cluster on files of renderers: those of the project's renders and those of other programs.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "deep/alpha.h"
#include "deep/cluster.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/ppu_scale.h"
#include "deep/tidy.h"
#include "flat/io.h"
#include "tests/reference/cluster.h"

namespace fathom::deep {
namespace {

std::string render(const std::string& name) {
  return FATHOM_SHARED "/renders/" + name;
}

void expectClose(const flat::Image& a, const flat::Image& b, const std::string& channel, double relative) {
  const auto &x = a.get(channel).values, &y = b.get(channel).values;
  double worst = 0;
  for (size_t p = 0; p < x.size(); ++p)
    worst = std::max(worst, std::abs(double(x[p]) - double(y[p])) / (0.01 + std::abs(double(y[p]))));
  EXPECT_LT(worst, relative) << channel;
}

class RealFile : public ::testing::TestWithParam<const char*> {};

TEST_P(RealFile, TidiesAndFlattens) {
  const DeepImage image = read(FATHOM_SHARED "/real/" + std::string(GetParam()));
  const DeepImage once = tidy(image.copy()).image, twice = tidy(once.copy()).image;
  EXPECT_TRUE(isTidy(once));
  ASSERT_EQ(twice.samples(), once.samples());
  const flat::Image before = flatten(image), after = flatten(once);
  for (const flat::Plane& plane : before.planes) expectClose(after, before, plane.name, 2e-5);
  for (const float alpha : before.get("A").values) EXPECT_TRUE(alpha >= 0 && alpha <= 1) << alpha;
}

INSTANTIATE_TEST_SUITE_P(All, RealFile,
                         ::testing::Values("Balls.exr", "Trunks.exr", "deepalpha.exr", "ids-42.deep.exr",
                                           "representativeDeepImage.exr"));

TEST(RealFile, OverlappingVolumesAreSplit) {
  const DeepImage image = read(FATHOM_SHARED "/real/representativeDeepImage.exr");
  EXPECT_TRUE(findUntidiness(image).volumesOverlap);
  EXPECT_GT(tidy(image.copy()).image.samples(), image.samples());
}

TEST(Render, EffectiveAlphaIsTheShareOfTheSamples) {
  const DeepImage image = read(render("staircase2.deep.exr"));
  const Buffer<float> alpha = effectiveAlpha(image);
  const auto samples = image.get("samples");
  const auto spp = float(*image.attributes.getInt("fathom:spp"));
  for (size_t i = 0; i < image.samples(); ++i) ASSERT_NEAR(alpha[i] * spp, samples[i], 1e-4f) << i;
}

TEST(Render, BinsFlattenToTheFlatRender) {
  for (const std::string name : {"fur", "kitchen"}) {
    const flat::Image expected = flat::read(render(name + ".flat.exr")),
                      found = flatten(read(render(name + ".deep.exr")));
    for (const char* channel : {"R", "G", "B", "albedo.G"}) expectClose(found, expected, channel, 2e-3);
    expectClose(found, expected, "A", 1e-6);
    expectClose(found, expected, "Z", 0.02);  // the bins' depths are their layout's, not their samples' own
  }
}

TEST(Render, VolumesOfTheSmokeAreTidy) {
  const DeepImage image = read(render("smoke.0001.deep.exr"));
  EXPECT_TRUE(isTidy(image));
  EXPECT_EQ(image.find("id")->type, PixelType::Uint);
}

class Samples : public ::testing::TestWithParam<const char*> {};

TEST_P(Samples, BecomeTheBinsOfTheTwin) {
  const DeepImage samples = read(render(GetParam() + std::string(".samples.exr")));
  const float scale = findPpuScale(samples.attributes, samples.displayWindow);
  const int spp = *samples.attributes.getInt("fathom:spp");
  const DeepImage bins = cluster(samples, findBins(samples, scale));
  const auto z = samples.get("Z"), green = samples.get("G"), a = samples.get("A"), alpha = bins.get("A");
  for (size_t p = 0; p < samples.pixels(); ++p) {
    std::vector<reference::CameraSample> camera;
    for (size_t i = samples.offsets[p]; i < samples.offsets[p + 1]; ++i)
      camera.push_back({double(z[i]), double(green[i]) / double(a[i])});
    const std::vector<reference::Bin> expected = reference::cluster(camera, double(scale), 2, 1);
    ASSERT_EQ(bins.count(p), expected.size()) << p;
    double passed = 1;
    for (size_t k = 0; k < expected.size(); ++k) {
      const size_t b = bins.offsets[p] + k;
      ASSERT_EQ(bins.get("samples")[b], float(expected[k].count)) << p;
      ASSERT_EQ(bins.get("Z")[b], float(expected[k].z)) << p;
      ASSERT_NEAR(bins.get("G")[b], expected[k].mean * double(alpha[b]), 1e-6 * expected[k].mean) << p;
      ASSERT_NEAR(bins.get("variance.Z")[b], expected[k].zVariance, 1e-6 * expected[k].zVariance) << p;
      ASSERT_NEAR(passed * double(alpha[b]) * spp, expected[k].count, 1e-6 * spp) << p;
      passed *= 1 - double(alpha[b]);
    }
  }
}

TEST_P(Samples, FlattenAsTheirBinsDo) {
  const DeepImage samples = read(render(GetParam() + std::string(".samples.exr")));
  const DeepImage bins = cluster(samples, findBins(samples, findPpuScale(samples.attributes, samples.displayWindow)));
  const flat::Image expected = flatten(samples), found = flatten(bins);
  for (const char* channel : {"R", "G", "B", "A", "diffuse.R", "specular.B", "albedo.R", "N.Z"})
    expectClose(found, expected, channel, 2e-5);
}

INSTANTIATE_TEST_SUITE_P(All, Samples, ::testing::Values("staircase2", "fur"));

}  // namespace
}  // namespace fathom::deep
