// One pixel: what is seen of each sample, and what stands in front of it.
#include "deep/ops/sample.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "base/error.h"
#include "cli/sample_report.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/transmittance.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::randomSamples;

TEST(Sample, WhatIsSeenSumsToAlpha) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomSamples(
        {.seed = seed, .volumes = seed % 2 == 0, .most = 9, .odd = seed % 5 == 0, .sorted = seed % 3 != 0});
    const flat::Image flat = flatten(image);
    for (size_t p = 0; p < image.pixels(); ++p) {
      const size_t width = size_t(image.dataWindow.width());
      double sum = 0;
      for (const SampleLight& sample :
           lightOf(image, image.dataWindow.x0 + int(p % width), image.dataWindow.y0 + int(p / width)))
        sum += sample.seen;
      ASSERT_NEAR(sum, flat.get("A").values[p], 1e-6) << "seed " << seed << " pixel " << p;
    }
  }
}

TEST(Sample, WhatIsInFrontIsTheTransmittanceThere) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = seed % 2 == 0, .most = 9, .sorted = seed % 3 != 0});
    const std::span<const float> zBack = image.tryGet("ZBack");
    for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y)
      for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x) {
        const std::vector<SampleLight> light = lightOf(image, x, y);
        const size_t pixel = image.dataWindow.index(x, y), first = image.offsets[pixel], count = image.count(pixel);
        const reference::PixelSamples samples{image.get("A").subspan(first, count),
                                              image.get("Z").subspan(first, count),
                                              zBack.empty() ? zBack : zBack.subspan(first, count)};
        for (size_t i = 0; i < count; ++i) {
          const bool volume = samples.back(i) > samples.z[i];  // behind points at its Z
          ASSERT_NEAR(light[i].front, double(reference::transmittance(samples, samples.z[i], volume)), 1e-6)
              << "seed " << seed << " at " << x << " " << y;
        }
      }
  }
}

TEST(Sample, WhatPassesToAnyDepth) {
  const std::vector<float> depths{-1, 0.5f, 1, 1.25f, 2, 2.1f, 3.3f, 5, 7, 100};
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples(
        {.seed = seed, .volumes = seed % 2 == 0, .most = 9, .odd = seed % 3 == 0, .sorted = seed % 4 != 0});
    for (size_t d = 0; d < depths.size(); ++d) {
      const flat::Image front = flatten(clip(image, -std::numeric_limits<float>::infinity(), depths[d]));
      for (size_t p = 0; p < image.pixels(); ++p) {
        const int width = image.dataWindow.width(), x = image.dataWindow.x0 + int(p) % width,
                  y = image.dataWindow.y0 + int(p) / width;
        ASSERT_NEAR(passingTo(image, x, y, depths)[d], 1 - front.get("A").values[p], 1e-6)
            << "seed " << seed << " pixel " << p << " depth " << depths[d];
      }
    }
  }
  EXPECT_THROW(passingTo(makeDeep({{}}, 1), 4, -2, depths), Error);
}

TEST(Sample, OutsideIsAnError) {
  const DeepImage image = makeDeep({{}}, 1);
  EXPECT_TRUE(lightOf(image, 3, -2).empty());
  EXPECT_THROW(lightOf(image, 4, -2), Error);
  EXPECT_THROW(lightOf(image, 3, -3), Error);
}

TEST(SampleReport, TellsEverySample) {
  const DeepImage image = makeDeep({{{1, 1, 0.25f, 0.5f, 0xffffffff}, {2, 3, 0.5f, 0.1f, 7}}}, 1);
  const std::vector<std::string> lines = cli::sampleTable(image, 3, -2);
  const std::vector<std::string> expected = {
      "pixel (3, -2): 2 samples, alpha 0.625",
      "      Z           1      2",
      "  ZBack           1      3",
      "      A        0.25    0.5",
      "   seen        0.25  0.375",
      "  front           1   0.75",
      "      R         0.5    0.1",
      "      B           1    0.2",
      "     id  4294967295      7",
  };
  EXPECT_EQ(lines, expected);
}

TEST(SampleReport, ManySamplesStandBelowOneAnother) {
  const std::vector<reference::Sample> samples(20, {2, 2, 0.5f});
  const std::vector<std::string> lines = cli::sampleTable(makeDeep({samples}, 1), 3, -2);
  ASSERT_EQ(lines.size(), 22u);
  EXPECT_EQ(lines[1], "  Z  ZBack    A  seen  front  R  B  id");
}

TEST(SampleReport, JsonHoldsTheBits) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true});
    for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y)
      for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x) {
        const auto json = nlohmann::json::parse(cli::sampleJson(image, x, y).dump());
        const size_t first = image.offsets[image.dataWindow.index(x, y)];
        ASSERT_EQ(json["samples"].size(), image.count(image.dataWindow.index(x, y)));
        for (size_t i = 0; i < json["samples"].size(); ++i) {
          const auto& channels = json["samples"][i]["channels"];
          ASSERT_EQ(channels["id"], image.find("id")->ids[first + i]);
          for (const char* name : {"R", "A", "Z"}) {
            const float value = image.get(name)[first + i];
            const float found = channels[name].is_string() ? std::stof(channels[name].get<std::string>())
                                                           : float(channels[name].get<double>());
            ASSERT_TRUE(found == value || (std::isnan(found) && std::isnan(value))) << name << " seed " << seed;
          }
        }
      }
  }
}

}  // namespace
}  // namespace fathom::deep
