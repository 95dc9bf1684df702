// Bins as pictures, and the flat frame that bins come to.
#include "deep/bin_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "deep/alpha.h"
#include "deep/flat_noisy.h"
#include "deep/flatten.h"
#include "tests/reference/rendered_frame.h"

namespace fathom::deep {
namespace {

DenoiseInputs inputsOf(const DeepImage& image) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  return findDenoiseInputs(names, image.attributes);
}

TEST(BinImage, ShowsTheKthBinOfEveryPixel) {
  const DeepImage image = reference::renderFrame().noisy;
  const auto pictures = binImages(image, inputsOf(image), 3);
  ASSERT_EQ(pictures.size(), 3u);
  const auto red = image.get("R"), albedo = image.get("albedo.G"), alpha = image.get("A");
  for (size_t pixel = 0; pixel < image.pixels(); ++pixel)
    for (size_t k = 0; k < 3; ++k) {
      const size_t count = image.count(pixel);
      ASSERT_EQ(pictures[k].get("asked").values[pixel], count > k ? 1 : 0);
      ASSERT_EQ(pictures[k].get("A").values[pixel], count > 0 ? 1 : 0);
      if (count == 0) {
        ASSERT_EQ(pictures[k].get("R").values[pixel], 0);
        continue;
      }
      const size_t bin = size_t(image.offsets[pixel]) + std::min(k, count - 1);
      ASSERT_FLOAT_EQ(pictures[k].get("R").values[pixel], red[bin] / alpha[bin]);
      ASSERT_FLOAT_EQ(pictures[k].get("albedo.G").values[pixel], albedo[bin] / alpha[bin]);
    }
}

TEST(BinImage, TheWayBackIsTheInverse) {
  const DeepImage image = reference::renderFrame().noisy;
  const auto pictures = binImages(image, inputsOf(image), 8);
  const Buffer<float> colours = fromBinImages(image, pictures);
  const auto alpha = image.get("A");
  const std::array names{"R", "G", "B"};
  for (size_t bin = 0; bin < image.samples(); ++bin)
    for (size_t c = 0; c < 3; ++c) ASSERT_FLOAT_EQ(colours[3 * bin + c] * alpha[bin], image.get(names[c])[bin]);
  // Fewer pictures than bins: those behind are not known. A part of the rows: the same.
  const Buffer<float> first = fromBinImages(image, std::span(pictures).first(1));
  const Box& box = image.dataWindow;
  const DeepImage below = rows(image, box.y0 + 11, box.y1 - 2);
  const Buffer<float> part = fromBinImages(below, pictures);
  const size_t before = size_t(image.offsets[11 * size_t(box.width())]);
  for (size_t i = 0; i < part.size(); ++i) ASSERT_EQ(part[i], colours[3 * before + i]);
  for (size_t pixel = 0; pixel < image.pixels(); ++pixel)
    for (size_t b = size_t(image.offsets[pixel]); b < size_t(image.offsets[pixel + 1]); ++b)
      ASSERT_EQ(std::isnan(first[3 * b]), b > size_t(image.offsets[pixel])) << pixel;
}

TEST(BinImage, WhatCannotBeSeenOrUsedIsPassedOver) {
  DeepImage image = reference::renderFrame({.emission = true}).noisy;
  const auto plain = binImages(image, inputsOf(image), 2);
  size_t poisoned = 0;
  for (size_t pixel = 0; pixel < image.pixels() && !poisoned; ++pixel)
    if (image.count(pixel) > 1 && image.get("A")[image.offsets[pixel]] > 0) {
      image.get("R")[image.offsets[pixel]] = std::numeric_limits<float>::quiet_NaN();
      poisoned = pixel;
    }
  ASSERT_GT(poisoned, 0u);
  const auto pictures = binImages(image, inputsOf(image), 2);
  EXPECT_EQ(pictures[0].get("R").values[poisoned], plain[1].get("R").values[poisoned]);
  const auto alpha = image.get("A");
  bool emission = false;
  for (size_t pixel = 0; pixel < image.pixels(); ++pixel)
    emission |= image.count(pixel) > 0 && alpha[image.offsets[pixel]] == 0;
  EXPECT_TRUE(emission);
  for (const flat::Plane& plane : pictures[0].planes)
    for (const float v : plane.values) ASSERT_TRUE(std::isfinite(v)) << plane.name;
}

TEST(BinImage, WhatIsHardlyThereIsPassedOver) {
  DeepImage image = reference::renderFrame().noisy;
  size_t pixel = 0;
  while (image.count(pixel) < 2) ++pixel;
  const size_t first = size_t(image.offsets[pixel]);
  image.get("A")[first] = 1e-8f;
  EXPECT_FLOAT_EQ(binImages(image, inputsOf(image), 1)[0].get("R").values[pixel],
                  image.get("R")[first + 1] / image.get("A")[first + 1]);
}

TEST(BinImage, SharesAreTheEffectiveAlpha) {
  const DeepImage image = reference::renderFrame().noisy;
  const Buffer<float> weight = effectiveAlpha(image);
  double all = 0;
  for (const float w : weight) all += double(w);
  double sum = 0;
  const std::vector<double> shares = binShares(image, 8);
  for (size_t k = 0; k < shares.size(); ++k) {
    EXPECT_LE(shares[k], all);
    sum += shares[k];
  }
  EXPECT_NEAR(sum, all, 1e-4 * all);
}

TEST(FlatNoisy, FlattensAsFlattenDoes) {
  const DeepImage image = reference::renderFrame({.emission = true}).noisy;
  const flat::Image noisy = flattenNoisy(image, inputsOf(image)), expected = flatten(image);
  for (const char* name : {"R", "G", "B", "A", "Z", "diffuse.R", "specular.B", "albedo.G", "N.Z"})
    for (size_t i = 0; i < image.pixels(); ++i)
      ASSERT_NEAR(noisy.get(name).values[i], expected.get(name).values[i], 2e-5) << name << " " << i;
}

// Bins made of camera samples that are known: the pixel's variance is that of all of them.
// Half covered, by one bin; nothing tells how many camera samples there were, but those of the bin.
TEST(FlatNoisy, OfAPixelThatIsHalfCovered) {
  DeepImage image{{0, 0, 1, 1}, {0, 0, 1, 1}, Buffer<uint64_t>(2, 0), {}, {}};
  image.offsets[1] = 1;
  for (const auto& [name, value] : {std::pair{"R", 1.0f},
                                    {"G", 1.0f},
                                    {"B", 1.0f},
                                    {"A", 0.5f},
                                    {"Z", 5.0f},
                                    {"samples", 8.0f},
                                    {"variance.Z", 0.25f}})
    image.add(name, PixelType::Float).values.fill(value);
  const flat::Image flat = flattenNoisy(image, inputsOf(image));
  EXPECT_EQ(flat.get("samples").values[0], 16);
  EXPECT_EQ(flat.get("Z").values[0], 5);
  EXPECT_FLOAT_EQ(flat.get("variance.Z").values[0], 0.25f) << "of what is seen";
}

TEST(FlatNoisy, VarianceIsThatOfTheCameraSamples) {
  const std::array<std::vector<double>, 3> samples{{{1, 2, 4}, {0.5, 0.25}, {3}}};
  const double spp = 8;  // two of them saw nothing
  DeepImage image{{0, 0, 1, 1}, {0, 0, 1, 1}, Buffer<uint64_t>(2), {}, {}};
  image.offsets[0] = 0;
  image.offsets[1] = samples.size();
  image.attributes.set("fathom:spp", int(spp));
  std::vector<double> everything(2, 0.0);
  for (const char* name : {"R", "G", "B", "A", "Z", "samples", "variance.R", "variance.G", "variance.B"})
    image.add(name, PixelType::Float);
  double left = spp;
  for (size_t b = 0; b < samples.size(); ++b) {
    double mean = 0, variance = 0;
    const double n = double(samples[b].size());
    for (const double x : samples[b]) mean += x / n, everything.push_back(x);
    for (const double x : samples[b]) variance += n > 1 ? (x - mean) * (x - mean) / (n - 1) / n : 0;
    const double alpha = n / left;
    left -= n;
    image.get("A")[b] = float(alpha);
    image.get("Z")[b] = float(b + 1);
    image.get("samples")[b] = float(n);
    for (const char* name : {"R", "G", "B"}) {
      image.get(name)[b] = float(alpha * mean);
      image.get(std::string("variance.") + name)[b] = float(variance);
    }
  }
  double mean = 0, variance = 0;
  for (const double x : everything) mean += x / spp;
  for (const double x : everything) variance += (x - mean) * (x - mean) / (spp - 1) / spp;
  const flat::Image noisy = flattenNoisy(image, inputsOf(image));
  EXPECT_NEAR(noisy.get("R").values[0], mean, 1e-5);
  EXPECT_NEAR(noisy.get("variance.G").values[0], variance, 1e-6);
  EXPECT_EQ(noisy.get("samples").values[0], 8);
}

}  // namespace
}  // namespace fathom::deep
