// What a flat denoiser's guide does to bins: they come nearer to the truth and add up to the guide, and nothing else
// changes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "deep/alpha.h"
#include "deep/base_guide.h"
#include "deep/consistency.h"
#include "deep/flat_nl_means.h"
#include "deep/flatten.h"
#include "tests/reference/rendered_frame.h"

namespace fathom::deep {
namespace {

constexpr std::array kNames{"R", "G", "B"};

DenoisePlan guidedPlan(const DeepImage& image) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  DenoisePlan plan{findDenoiseInputs(names, image.attributes), {}, meanLevel(image)};
  plan.guided = true;
  return plan;
}

// A denoiser that knows the answer, or nearly.
flat::Denoiser knows(const flat::Image& answer, float wrong = 0) {
  return [&answer, wrong](const flat::Image& noisy, const Progress&) {
    flat::Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
    for (const char* name : kNames) {
      result.planes.push_back({name, answer.get(name).values.copy()});
      for (float& v : result.planes.back().values) v *= 1 + wrong;
    }
    return result;
  };
}

// Squared errors: of the flattened frame, and of bins weighted by their effective alpha.
struct Errors {
  double flat = 0, bins = 0;
};

Errors errorsOf(const DeepImage& image, const DeepImage& truth) {
  Errors result;
  const flat::Image a = flatten(image), b = flatten(truth);
  const Buffer<float> weight = effectiveAlpha(truth);
  const auto alpha = truth.get("A");
  for (const char* name : kNames) {
    for (size_t i = 0; i < truth.pixels(); ++i)
      result.flat += std::pow(double(a.get(name).values[i] - b.get(name).values[i]), 2);
    for (size_t i = 0; i < truth.samples(); ++i)
      if (alpha[i] > 0)
        result.bins += double(weight[i]) * std::pow(double((image.get(name)[i] - truth.get(name)[i]) / alpha[i]), 2);
  }
  return result;
}

class Guided : public ::testing::Test {
 protected:
  const reference::RenderedFrame frame = reference::renderFrame({.width = 64, .height = 48});
  const DenoisePlan plan = guidedPlan(frame.noisy);
  const flat::Image truth = flatten(frame.truth);

  DeepImage guided(const GuideDenoisers& denoisers) const {
    const BaseGuide guide = makeGuide(guideInput(frame.noisy, plan, bool(denoisers.bins)), denoisers, plan);
    return denoise(frame.noisy.copy(), plan, {}, nullptr, &guide);
  }
};

TEST_F(Guided, AGoodGuideMakesBothBetter) {
  const Errors before = errorsOf(denoise(frame.noisy.copy(), plan), frame.truth);
  const Errors after = errorsOf(guided({knows(truth), {}, {}}), frame.truth);
  EXPECT_LT(after.flat, 0.5 * before.flat);
  EXPECT_LT(after.bins, 0.95 * before.bins);
}

TEST_F(Guided, PicturesOfBinsMakeBinsBetter) {
  const auto answers = binImages(frame.truth, {}, kMostBinImages);
  size_t next = 0;
  const flat::Denoiser bins = [&](const flat::Image& noisy, const Progress& progress) {
    return knows(answers[next++])(noisy, progress);
  };
  const Errors flatOnly = errorsOf(guided({knows(truth), {}, {}}), frame.truth);
  const Errors both = errorsOf(guided({knows(truth), bins, {}}), frame.truth);
  EXPECT_GE(next, 2u);
  EXPECT_LT(both.bins, 0.7 * flatOnly.bins);
}

// A third too bright everywhere: the noisy frame tells, and less than a tenth of the guide's error comes through.
TEST_F(Guided, ABadGuideDoesLittleHarm) {
  const float wrong = 0.3f;
  double guideError = 0;
  for (const char* name : kNames)
    for (const float v : truth.get(name).values) guideError += std::pow(double(wrong * v), 2);
  const Errors before = errorsOf(denoise(frame.noisy.copy(), plan), frame.truth);
  const Errors after = errorsOf(guided({knows(truth, wrong), {}, {}}), frame.truth);
  EXPECT_LT(after.flat - before.flat, 0.1 * guideError);
  EXPECT_LT(after.bins - before.bins, 0.1 * guideError);
}

// Few samples that all missed the light are sure that there is none.
TEST_F(Guided, DarkBinsTakeTenOfTheirDeviationsFromIt) {
  const DenoiseData data = prepareColours(frame.noisy, plan.inputs);
  const BaseGuide guide = makeGuide(guideInput(frame.noisy, plan, false), {knows(truth), {}, {}}, plan);
  const float deviation = 0.02f * plan.level;
  flat::GateVerdict gate;
  for (float& noise : gate.noise) noise = deviation * deviation / guide.consistency.noise;
  const Buffer<flat::GateVerdict> gates(data.bins(), gate);
  Buffer<float> colours(3 * data.bins(), 0.0f);
  makeConsistent(frame.noisy, data, guide, gates, Buffer<uint8_t>(frame.noisy.pixels(), 0), plan.level, colours);
  int bright = 0;
  for (size_t p = 0; p < frame.noisy.pixels(); ++p) {
    const size_t b = frame.noisy.offsets[p];
    if (frame.noisy.count(p) != 1 || data.weight[b] < 0.99f) continue;
    for (size_t c = 0; c < 3; ++c) {
      if (guide.flattened.get(kNames[c]).values[p] < plan.level) continue;
      ++bright;
      ASSERT_NEAR(colours[3 * b + c], 10 * deviation, 0.1f * deviation) << "pixel " << p;
    }
  }
  EXPECT_GT(bright, 100);
}

TEST_F(Guided, NothingElseChangesAndComponentsAddUp) {
  const DeepImage out = guided({knows(truth), {}, {}});
  for (const char* name : {"A", "Z"})
    EXPECT_EQ(0, std::memcmp(out.get(name).data(), frame.noisy.get(name).data(), out.samples() * sizeof(float)));
  EXPECT_EQ(out.offsets.size(), frame.noisy.offsets.size());
  for (const std::string name : kNames)
    for (size_t i = 0; i < out.samples(); ++i) {
      ASSERT_NEAR(out.get(name)[i], out.get("diffuse." + name)[i] + out.get("specular." + name)[i], 2e-6);
      ASSERT_GE(out.get(name)[i], -1e-6f);
    }
}

TEST_F(Guided, AComponentWithoutLightStaysDark) {
  DeepImage image = frame.noisy.copy();
  for (const std::string half : {"", "half0.", "half1."})
    for (const std::string name : kNames) {
      const auto whole = image.get(half + name), diffuse = image.get(fmt::format("{}diffuse.{}", half, name));
      std::copy(diffuse.begin(), diffuse.end(), whole.begin());
      std::ranges::fill(image.get(fmt::format("{}specular.{}", half, name)), 0.0f);
    }
  const BaseGuide guide = makeGuide(guideInput(image, plan, false), {knows(truth), {}, {}}, plan);
  const DeepImage out = denoise(image.copy(), plan, {}, nullptr, &guide);
  for (const std::string name : kNames)
    for (const float v : out.get("specular." + name)) ASSERT_EQ(v, 0);
}

// Glows in front, of no camera sample, and a bin that is not finite: the pixels around take the guide all the same.
TEST_F(Guided, WhatHasNoSayKeepsNoPixelFromItsGuide) {
  const reference::RenderedFrame glowing = reference::renderFrame({.width = 64, .height = 48, .emission = true});
  const flat::Image answer = flatten(glowing.truth);
  DeepImage noisy = glowing.noisy.copy();
  const size_t poisoned = noisy.offsets[30 * 64 + 30];
  for (Channel& channel : noisy.channels)
    if (channel.name.ends_with(".R") || channel.name == "R") channel.values[poisoned] = std::nanf("");
  const BaseGuide guide = makeGuide(guideInput(noisy, plan, false), {knows(answer), {}, {}}, plan);
  const flat::Image before = flatten(denoise(noisy.copy(), plan)),
                    after = flatten(denoise(noisy.copy(), plan, {}, nullptr, &guide));
  double unguided = 0, guided = 0;
  const auto alpha = noisy.get("A");
  for (const char* name : kNames)
    for (size_t p = 0; p < noisy.pixels(); ++p) {
      ASSERT_TRUE(std::isfinite(after.get(name).values[p])) << name << " of pixel " << p;
      if (noisy.count(p) == 0 || alpha[noisy.offsets[p]] > 0) continue;
      unguided += std::pow(double(before.get(name).values[p] - answer.get(name).values[p]), 2);
      guided += std::pow(double(after.get(name).values[p] - answer.get(name).values[p]), 2);
    }
  EXPECT_LT(guided, 0.5 * unguided);
}

TEST_F(Guided, BandsOfRowsGiveTheSameBits) {
  const flat::Denoiser own = flatNlMeans(planFlattened(plan));
  const DeepImage whole = guided({own, {}, kOwnGuide});
  const int halo = denoiseHalo(plan);
  const Box& box = frame.noisy.dataWindow;
  for (const auto& [y0, y1] : {std::pair{box.y0, box.y0 + 9}, {box.y0 + 20, box.y0 + 21}, {box.y1 - 5, box.y1}}) {
    const DeepImage band = rows(frame.noisy, std::max(y0 - halo, box.y0), std::min(y1 + halo, box.y1));
    const BaseGuide guide = makeGuide(guideInput(band, plan, false), {own, {}, kOwnGuide}, plan);
    const DeepImage part = rows(denoise(band.copy(), plan, {}, nullptr, &guide), y0, y1);
    const DeepImage expected = rows(whole, y0, y1);
    for (const Channel& channel : expected.channels) {
      if (channel.type == PixelType::Uint) continue;
      ASSERT_EQ(0, std::memcmp(channel.values.data(), part.get(channel.name).data(), channel.values.size() * 4))
          << channel.name << " rows " << y0 << " to " << y1;
    }
  }
}

TEST_F(Guided, GuidesOfPiecesAreThatOfTheWhole) {
  const Box& box = frame.noisy.dataWindow;
  GuideInput pieces = guideInput(rows(frame.noisy, box.y0, box.y0 + 13), plan, true);
  appendRows(pieces, guideInput(rows(frame.noisy, box.y0 + 13, box.y1), plan, true));
  const GuideInput whole = guideInput(frame.noisy, plan, true);
  ASSERT_EQ(pieces.noisy.dataWindow, whole.noisy.dataWindow);
  for (const flat::Plane& plane : whole.noisy.planes)
    EXPECT_EQ(0, std::memcmp(plane.values.data(), pieces.noisy.get(plane.name).values.data(), plane.values.size() * 4));
  EXPECT_TRUE(std::ranges::equal(pieces.calm, whole.calm));
  for (size_t k = 0; k < whole.bins.size(); ++k) {
    EXPECT_NEAR(pieces.shares[k], whole.shares[k], 1e-9 * (1 + whole.shares[k]));
    for (const flat::Plane& plane : whole.bins[k].planes)
      EXPECT_EQ(
          0, std::memcmp(plane.values.data(), pieces.bins[k].get(plane.name).values.data(), plane.values.size() * 4));
  }
}

TEST_F(Guided, HalvesAloneTellTheNoise) {
  DeepImage image = frame.noisy.copy();
  std::erase_if(image.channels, [](const Channel& channel) { return channel.name.starts_with("variance."); });
  const DenoisePlan halves = guidedPlan(image);
  const BaseGuide guide = makeGuide(guideInput(image, halves, false), {knows(truth), {}, {}}, halves);
  const Errors before = errorsOf(denoise(image.copy(), halves), frame.truth);
  EXPECT_LT(errorsOf(denoise(image.copy(), halves, {}, nullptr, &guide), frame.truth).flat, 0.5 * before.flat);
}

// Pictures that show hardly anything are not worth a run.
TEST_F(Guided, FewBinsHaveNoPicture) {
  GuideInput input = guideInput(frame.noisy, plan, true);
  ASSERT_GE(input.shares.size(), 2u);
  std::ranges::fill(input.shares, 0.01);
  input.shares[0] = 1;
  int runs = 0;
  const flat::Denoiser bins = [&](const flat::Image& noisy, const Progress& progress) {
    ++runs;
    return knows(truth)(noisy, progress);
  };
  EXPECT_EQ(makeGuide(std::move(input), {knows(truth), bins, {}}, plan).bins.size(), 1u);
  EXPECT_EQ(runs, 1);
}

// Where nothing is noisy bins keep their colours, and what a guide says is never seen: it may be anything.
TEST(GuideAsks, WhereTheDeepFilterWorks) {
  for (const bool variances : {true, false}) {
    reference::RenderedFrame frame =
        reference::renderFrame({.width = 120, .height = 40, .noise = [](int x, int) { return x < 60 ? 0.0f : 0.7f; }});
    if (!variances)
      std::erase_if(frame.noisy.channels, [](const Channel& channel) { return channel.name.starts_with("variance."); });
    const DenoisePlan plan = guidedPlan(frame.noisy);
    size_t least = frame.noisy.pixels(), most = 0;
    const auto denoiser = [&](float elsewhere) {
      return [&, elsewhere](const flat::Image& noisy, const Progress&) {
        flat::Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
        const Buffer<float>& asked = noisy.get(flat::kAsked).values;
        size_t count = 0;
        for (const char* name : kNames) {
          const Buffer<float>& from = noisy.get(name).values;
          Buffer<float>& to = result.add(name).values;
          for (size_t i = 0; i < to.size(); ++i) to[i] = asked[i] != 0 ? 0.9f * from[i] : elsewhere;
        }
        for (const float pixel : asked) count += pixel != 0;
        least = std::min(least, count), most = std::max(most, count);
        return result;
      };
    };
    const auto result = [&](float elsewhere) {
      const BaseGuide guide =
          makeGuide(guideInput(frame.noisy, plan, true), {denoiser(elsewhere), denoiser(elsewhere), {}}, plan);
      return denoise(frame.noisy.copy(), plan, {}, nullptr, &guide);
    };
    const DeepImage expected = result(0), found = result(1e4f);
    EXPECT_LT(most, frame.noisy.pixels() * 3 / 4) << variances;
    EXPECT_GT(most, frame.noisy.pixels() / 2) << variances;
    EXPECT_GT(least, 0u);
    for (const char* name : kNames)
      EXPECT_EQ(0, std::memcmp(found.get(name).data(), expected.get(name).data(), found.samples() * sizeof(float)))
          << name << " " << variances;
  }
}

TEST(GuideAsks, ForNothingOfAFrameWithoutNoise) {
  const reference::RenderedFrame frame = reference::renderFrame({.noise = [](int, int) { return 0.0f; }});
  const DenoisePlan plan = guidedPlan(frame.noisy);
  const flat::Denoiser never = [](const flat::Image&, const Progress&) -> flat::Image {
    throw std::logic_error("asked");
  };
  const BaseGuide guide = makeGuide(guideInput(frame.noisy, plan, true), {never, never, {}}, plan);
  const DeepImage out = denoise(frame.noisy.copy(), plan, {}, nullptr, &guide);
  for (const char* name : kNames)
    EXPECT_EQ(0, std::memcmp(out.get(name).data(), frame.noisy.get(name).data(), out.samples() * sizeof(float)));
}

TEST_F(Guided, TheGuideIsGatedOnce) {
  EXPECT_TRUE(plan.params.gate);
  EXPECT_FALSE(planFlattened(plan).params.gate);
}

// One bin a pixel: the deep filter is the flat one, and the flat one's guide is what is there already.
TEST(OneBin, TheDeepFilterIsTheFlatOne) {
  const DeepImage deep = reference::renderFrame().noisy;
  const flat::Image flat = flattenNoisy(deep, guidedPlan(deep).inputs);
  DeepImage bins{flat.dataWindow, flat.displayWindow, Buffer<uint64_t>(flat.dataWindow.area() + 1), {}, {}};
  for (size_t i = 0; i < bins.offsets.size(); ++i) bins.offsets[i] = i;
  for (const flat::Plane& plane : flat.planes) {
    Buffer<float>& values = bins.add(plane.name, PixelType::Float).values;
    std::copy(plane.values.begin(), plane.values.end(), values.begin());
    if (plane.name == "A") values.fill(1);
  }
  DenoisePlan plan = guidedPlan(bins);
  plan.guided = false;
  for (const FilterKind filter : {FilterKind::Own, FilterKind::Paper, FilterKind::Rdfc}) {
    plan.params.filter = filter;
    const flat::Image expected = flatNlMeans(planFlat(flat, {.filter = filter}))(flat, {});
    const DeepImage result = denoise(bins.copy(), plan);
    for (const char* name : kNames)
      for (size_t i = 0; i < expected.get(name).values.size(); ++i)
        ASSERT_NEAR(result.get(name)[i], expected.get(name).values[i],
                    1e-5 * (1 + std::fabs(expected.get(name).values[i])))
            << int(filter);
  }
}

}  // namespace
}  // namespace fathom::deep
