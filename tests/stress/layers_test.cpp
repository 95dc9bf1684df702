// The layered network on samples and bins of values at the ends of what files hold.
#include "deep/layers.h"

#include <gtest/gtest.h>

#include <map>

#include "deep/flatten.h"
#include "deep/layers_results.h"
#include "flat/finite.h"
#include "tests/reference/layered.h"
#include "tests/reference/rendered_frame.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::deep {
namespace {

using stress::extremeDeep;
using stress::record;

const nn::LayersNet& randomNet() {
  static const nn::LayersNet net(nn::readWeights(reference::safetensors(reference::randomLayered(16, 4)), "random"));
  return net;
}

const nn::LayersNet& trainedNet() {
  static const nn::LayersNet net(nn::readWeights(FATHOM_DEMO "/../models/layers.safetensors"));
  return net;
}

struct Results {
  flat::Image flat;
  DeepImage layers, bins;
  LayerScale scale;
  LayersCounts counts;
};

Results run(const DeepImage& image, const nn::LayersNet& net, int layers = 2) {
  Results results;
  const LayerSource source = layerSource(image);
  results.scale = measureLayers(source, {.layers = layers});
  denoiseLayers(
      net, {.layers = layers}, source, results.scale, image.dataWindow.y0, image.dataWindow.y1,
      [&](const LayeredRows& rows) {
        results.flat = flattenedLayers(rows);
        results.layers = layersImage(rows, image.attributes);
        results.bins = inLayerColours(image.copy(), rows, source.inputs);
      },
      {}, &results.counts);
  return results;
}

void expectFinite(const Results& results) {
  for (const flat::Plane& plane : results.flat.planes)
    for (const float v : plane.values) ASSERT_TRUE(std::isfinite(v)) << plane.name;
  for (const DeepImage* image : {&results.layers, &results.bins})
    for (const char* name : {"R", "G", "B"})
      for (const float v : image->get(name)) ASSERT_TRUE(std::isfinite(v)) << name;
}

// One deep sample per camera sample: `most` of them in the brightest pixel, none in some.
DeepImage cameraSamples(int width, int height, unsigned most, unsigned seed, float largest = 6e4f) {
  stress::Draw draw(seed);
  DeepImage image;
  image.dataWindow = image.displayWindow = {2, -1, 2 + width, -1 + height};
  image.offsets = Buffer<uint64_t>(image.pixels() + 1, uint64_t(0));
  for (size_t p = 0; p < image.pixels(); ++p)
    image.offsets[p + 1] = image.offsets[p] + (p == image.pixels() / 2 ? most : draw.below(4) ? 1 + draw.below(8) : 0);
  for (const char* name :
       {"A", "Z", "diffuse.R", "diffuse.G", "diffuse.B", "specular.R", "specular.G", "specular.B", "R", "G", "B"})
    image.add(name, PixelType::Float);
  for (size_t p = 0; p < image.pixels(); ++p) {
    float z = float(draw.power(1e-6, 1e6));
    const auto count = float(image.count(p));
    for (uint64_t s = image.offsets[p]; s < image.offsets[p + 1]; ++s) {
      image.get("A")[s] = 1 / (count - float(s - image.offsets[p]));
      image.get("Z")[s] = z = std::nextafter(draw.below(3) ? z : z * 1.5f, 1e30f);
      for (const char* c : {"R", "G", "B"}) {
        const float light = float(draw.below(5) ? draw.uniform(0.1, 2) : draw.power(1e-44, double(largest)));
        for (const char* group : {"diffuse.", "specular.", ""})
          image.get(std::string(group) + c)[s] = light * image.get("A")[s];
      }
    }
  }
  image.attributes.set("fathom:spp", int(most));
  return image;
}

// What the product gives the network of a frame, as the twin takes it.
reference::PlainSamples samplesOf(const DeepImage& image, const LayerScale& scale, uint64_t& count) {
  const LayerInputs inputs = layerSource(image).inputs;
  const int width = image.dataWindow.width(), height = image.dataWindow.height();
  reference::PlainSamples result((height + 3) / 4 * 4, (width + 3) / 4 * 4);
  count = 0;
  for (int y = 0; y < height; ++y) {
    const LayerRow row = layerRow(image, inputs, scale, image.dataWindow.y0 + y);
    count += row.samples.count();
    for (int x = 0; x < width; ++x)
      for (size_t s = row.samples.first[size_t(x)]; s < row.samples.first[size_t(x) + 1]; ++s) {
        reference::PlainSample sample;
        for (size_t p = 0; p < size_t(nn::kSampleInputs); ++p) sample.inputs.push_back(double(row.samples.plane(p)[s]));
        for (size_t c = 0; c < 6; ++c) sample.colour[c] = double(row.samples.plane(nn::kExposedAt + c)[s]);
        sample.depth = double(row.samples.plane(nn::kSampleDepth)[s]);
        result.at(y, x).push_back(std::move(sample));
      }
  }
  return result;
}

// Of the brightest sample: kernels reach over all of so small a frame.
void expectLikeTwin(const DeepImage& image, int layers) {
  constexpr double kBound = 1e-4;
  static const reference::PlainWeights weights = reference::randomLayered(16, 4);
  const Results found = run(image, randomNet(), layers);
  uint64_t count = 0;
  const reference::PlainSamples samples = samplesOf(image, found.scale, count);
  const reference::LayeredResult expected =
      reference::LayeredTwin(weights).denoise(samples, layers, found.scale.lights);
  double most = 1e-30, worst = 0;
  for (const auto& pixel : samples.pixels)
    for (const auto& sample : pixel)
      for (const double c : sample.colour) most = std::max(most, std::fabs(c));
  const int width = image.dataWindow.width();
  const flat::Image flattened = found.flat.copy();
  // Light of samples without alpha comes on top, and is not the network's.
  const LayerSource source = layerSource(image);
  Buffer<float> glow(3 * image.pixels(), 0.0f);
  for (int y = 0; y < image.dataWindow.height(); ++y) {
    const LayerRow row = layerRow(image, source.inputs, found.scale, image.dataWindow.y0 + y);
    for (size_t c = 0; c < 3; ++c)
      std::copy_n(row.emission.data() + c * size_t(width), width, glow.data() + c * image.pixels() + size_t(y * width));
  }
  for (size_t i = 0; i < image.pixels(); ++i) {
    const int y = int(i) / width, x = int(i) % width;
    for (size_t c = 0; c < 3; ++c) {
      const double own = double(flattened.planes[c].values[i]) - double(glow[c * image.pixels() + i]);
      const double rounding = 1e-6 * std::fabs(double(glow[c * image.pixels() + i]) * double(found.scale.exposure));
      const double error = std::fabs(own * double(found.scale.exposure) - expected.flat.at(int(c), y, x)) - rounding;
      worst = std::max(worst, error / most);
    }
    worst = std::max(worst, std::fabs(double(flattened.planes[3].values[i]) - expected.flat.at(3, y, x)));
  }
  record("layered network, L = " + std::to_string(layers),
         "values, alphas, depths, up to 10,000 samples: against the twin", worst, kBound);
  EXPECT_LT(worst, kBound) << width << ", " << layers << " layers";
}

TEST(StressLayers, EqualsItsTwin) {
  for (int round = 0; round < stress::rounds(); ++round) {
    const auto seed = unsigned(round + 1);
    expectLikeTwin(extremeDeep({.width = 13, .height = 9, .seed = seed}), 2);
    expectLikeTwin(extremeDeep({.width = 1, .height = 10, .seed = seed, .largest = 9e14f}), 4);
    expectLikeTwin(extremeDeep({.width = 11, .height = 1, .seed = seed, .features = false}), 1);
    expectLikeTwin(extremeDeep({.width = 1, .height = 1, .seed = seed, .empty = 0}), 2);
    expectLikeTwin(cameraSamples(8, 5, 10000, seed), 2);
  }
}

TEST(StressLayers, AnyFrameGivesFiniteColours) {
  for (int round = 0; round < stress::rounds(); ++round)
    for (const auto& [width, height] : {std::pair{1, 1}, {1, 21}, {23, 1}, {17, 14}})
      for (const float largest : {6e4f, 9e14f})
        for (const double empty : {0.1, 0.95, 1.0})
          for (const int layers : {1, 2, 4}) {
            SCOPED_TRACE(testing::Message() << width << "x" << height << " to " << largest << ", empty " << empty);
            expectFinite(run(extremeDeep({.width = width,
                                          .height = height,
                                          .seed = unsigned(round + 5),
                                          .empty = empty,
                                          .largest = largest}),
                             trainedNet(), layers));
          }
  expectFinite(run(cameraSamples(9, 7, 10000, 3, 9e14f), trainedNet(), 4));
}

TEST(StressLayers, FollowsTheExposure) {
  constexpr double kBound = 1e-4;
  double worst = 0;
  for (const nn::LayersNet* net : {&randomNet(), &trainedNet()}) {
    const DeepImage image = reference::renderFrame({.width = 28, .height = 20, .emission = true}).noisy;
    const Results expected = run(image, *net);
    double most = 0;
    for (size_t c = 0; c < 3; ++c)
      for (const float v : expected.flat.planes[c].values) most = std::max(most, std::fabs(double(v)));
    for (const std::span<const float> scales : {std::span(stress::kExactScales), std::span(stress::kRoundedScales)})
      for (const float scale : scales) {
        const Results found = run(stress::scaled(image, scale), *net);
        for (size_t c = 0; c < 3; ++c)
          for (size_t i = 0; i < image.pixels(); ++i)
            worst = std::max(worst, std::fabs(double(found.flat.planes[c].values[i]) / double(scale) -
                                              double(expected.flat.planes[c].values[i])) /
                                        most);
        for (const char* name : {"R", "G", "B"})
          for (size_t i = 0; i < image.samples(); ++i)
            worst = std::max(
                worst,
                std::fabs(double(found.bins.get(name)[i]) / double(scale) - double(expected.bins.get(name)[i])) / most);
      }
  }
  record("layered network", "exposure over 12 powers of ten", worst, kBound);
  EXPECT_LT(worst, kBound);
}

// Exposure, mean depth and the curve of light are of the whole frame; given these, poison out of reach changes no bits.
TEST(StressLayers, PoisonStaysWithinReach) {
  constexpr int kLength = 200;
  const DeepImage clean = reference::renderFrame({.width = kLength, .height = 4}).noisy;
  const nn::LayersNet& net = randomNet();
  LayerScale scale = measureLayers(layerSource(clean), {});
  scale.light = measureLight(net, {}, layerSource(clean), scale);
  const auto flatOf = [&](const DeepImage& image) {
    flat::Image result;
    denoiseLayers(net, {}, layerSource(image), scale, image.dataWindow.y0, image.dataWindow.y1,
                  [&](const LayeredRows& rows) {
                    result = flattenedLayers(rows);
                    for (const char* name : {"R", "G", "B"}) {
                      const DeepImage bins = inLayerColours(image.copy(), rows, layerSource(image).inputs);
                      for (const float v : bins.get(name)) ASSERT_TRUE(std::isfinite(v));
                    }
                  });
    return result;
  };
  const flat::Image expected = flatOf(clean);
  stress::Draw draw(3);
  double worst = 0;
  for (int round = 0; round < 30 * stress::rounds(); ++round) {
    DeepImage image = clean.copy();
    const size_t x = draw.below(kLength), pixel = x + kLength * draw.below(4);
    if (image.count(pixel) == 0) continue;
    Channel& channel = draw.below(2) ? *image.find(draw.below(2) ? "diffuse.R" : "specular.G")
                                     : image.channels[draw.below(unsigned(image.channels.size()))];
    if (channel.type == PixelType::Uint) continue;
    const float value =
        draw.of({stress::kNan, stress::kInfinity, -stress::kInfinity, -1, -1e10f, 1e20f, 9e14f, 1e-42f, 0});
    channel.values[image.offsets[pixel] + draw.below(unsigned(image.count(pixel)))] = value;
    SCOPED_TRACE(fmt::format("{} {} at {}", channel.name, value, x));
    const flat::Image found = flatOf(image);
    for (const char* c : {"R", "G", "B", "A"})
      for (size_t p = 0; p < image.pixels(); ++p) {
        const float v = found.get(c).values[p], was = expected.get(c).values[p];
        ASSERT_TRUE(std::isfinite(v)) << c;
        if (std::abs(int(p % kLength) - int(x)) <= net.halo() + nn::LayersNet::kAlignment) continue;
        ASSERT_TRUE(stress::sameBits(v, was)) << c << " " << p % kLength << ": " << v << ", " << was;
      }
    const LayerScale own = measureLayers(layerSource(image), {});
    worst = std::max(worst, std::fabs(double(own.exposure / scale.exposure) - 1));
  }
  // A block of 25 that is 1e14 times as bright moves the geometric mean by a factor of 1e14^(1/25).
  record("layered network", "poison: what the exposure moves by, of 25 blocks", worst, 0.8);
  EXPECT_LT(worst, 0.8);
}

}  // namespace
}  // namespace fathom::deep
