// Laws of the deep denoiser, on small frames whose noise-free bins are known. What its parts compute is tested against
// their twins (joint_filter_test and others); its errors on renders in tests/data.
#include "deep/denoise.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <bit>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/rendered_frame.h"

namespace fathom::deep {
namespace {

using reference::binError;
using reference::difference;
using reference::flatError;
using reference::RenderedFrame;
using reference::renderFrame;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
const std::vector<std::string> kRgb{"R", "G", "B"};
const std::vector<std::string> kColours{"R",         "G",          "B",          "diffuse.R", "diffuse.G",
                                        "diffuse.B", "specular.R", "specular.G", "specular.B"};

DenoisePlan planFor(const DeepImage& image, const DenoiseParams& params = {}) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  return {findDenoiseInputs(names, image.attributes), params, meanLevel(image)};
}

DeepImage run(const DeepImage& image, const DenoiseParams& params = {}) {
  return denoise(image.copy(), planFor(image, params));
}

void dropGroup(DeepImage& image, const std::string& start) {
  std::erase_if(image.channels, [&](const Channel& c) { return c.name.starts_with(start); });
}

bool sameBits(float a, float b) {
  return std::bit_cast<uint32_t>(a) == std::bit_cast<uint32_t>(b);
}

void expectFinite(const DeepImage& image, const std::string& what) {
  for (const std::string& name : kColours)
    for (const float v : image.tryGet(name)) ASSERT_TRUE(std::isfinite(v)) << what << ": " << name;
}

// The largest difference of the colours of an image from those of another, in units of `scale`.
double farthest(const DeepImage& a, const DeepImage& b, double scale = 1) {
  double worst = 0;
  for (const std::string& name : kRgb) {
    const auto x = a.get(name), y = b.get(name);
    for (size_t i = 0; i < x.size(); ++i) worst = std::max(worst, std::fabs(double(x[i]) - double(y[i])) / scale);
  }
  return worst;
}

// The first bin of the pixel counted from the window's corner; the pixel must have one.
size_t binAt(const DeepImage& image, int x, int y) {
  const size_t pixel = size_t(y) * size_t(image.dataWindow.width()) + size_t(x);
  EXPECT_GT(image.count(pixel), 0u);
  return image.offsets[pixel];
}

TEST(Denoise, LowersTheErrorInEveryQualityAndWithOrWithoutTheGate) {
  const RenderedFrame frame = renderFrame();
  const double flat = flatError(frame.noisy, frame.truth), bins = binError(frame.noisy, frame.truth);
  for (const Quality quality : {Quality::Fast, Quality::Balanced, Quality::Best})
    for (const bool gate : {true, false}) {
      const DeepImage out = run(frame.noisy, {.quality = quality, .gate = gate});
      expectFinite(out, "quality");
      EXPECT_LT(flatError(out, frame.truth), 0.35 * flat) << int(quality) << gate;
      EXPECT_LT(binError(out, frame.truth), 0.35 * bins) << int(quality) << gate;
    }
}

TEST(Denoise, LeavesBinsAndUnknownChannelsAlone) {
  const RenderedFrame frame = renderFrame({.volumes = true, .emission = true});
  const DeepImage out = run(frame.noisy);
  std::set<std::string> names;
  for (const Channel& channel : out.channels) names.insert(channel.name);
  EXPECT_EQ(names, (std::set<std::string>{"A",         "B",        "G",          "N.X",        "N.Y",
                                          "N.Z",       "R",        "Z",          "ZBack",      "albedo.B",
                                          "albedo.G",  "albedo.R", "crypto",     "diffuse.B",  "diffuse.G",
                                          "diffuse.R", "id",       "specular.B", "specular.G", "specular.R"}));
  DeepImage before = frame.noisy.copy(), after = out.copy();
  for (const char* statistic : {"half0.", "half1.", "variance.", "samples"}) dropGroup(before, statistic);
  for (const std::string& name : kColours) {
    before.erase(name);
    after.erase(name);
  }
  EXPECT_EQ(difference(before, after), "");
  EXPECT_EQ(out.attributes.getInt("fathom:spp"), 32);
}

TEST(Denoise, KeepsStatisticsWhereAsked) {
  const RenderedFrame frame = renderFrame();
  DeepImage before = frame.noisy.copy(), after = run(frame.noisy, {.keepStatistics = true});
  EXPECT_EQ(farthest(after, run(frame.noisy)), 0);
  for (const std::string& name : kColours) {
    before.erase(name);
    after.erase(name);
  }
  EXPECT_EQ(difference(before, after), "");
}

TEST(Denoise, ColourIsTheSumOfItsComponents) {
  const DeepImage out = run(renderFrame().noisy);
  for (const std::string& rgb : kRgb) {
    const auto whole = out.get(rgb), diffuse = out.get("diffuse." + rgb), specular = out.get("specular." + rgb);
    for (size_t i = 0; i < whole.size(); ++i) ASSERT_FLOAT_EQ(whole[i], diffuse[i] + specular[i]) << i;
  }
}

TEST(Denoise, GivesTheSameBitsForAnyNumberOfThreads) {
  const RenderedFrame frame = renderFrame({.width = 75, .height = 50});
  for (const Quality quality : {Quality::Fast, Quality::Balanced, Quality::Best}) {
    DeepImage expected;
    for (const size_t threads : {1u, 2u, 5u}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      DeepImage out = run(frame.noisy, {.quality = quality});
      if (threads == 1)
        expected = std::move(out);
      else
        EXPECT_EQ(difference(expected, out), "") << threads << " threads";
    }
  }
}

// What a band of rows gives with the halo around it is what the whole frame gives there.
void expectBandsAgree(const DeepImage& image, const DenoisePlan& plan, int bandHeight) {
  const DeepImage whole = denoise(image.copy(), plan);
  const Box window = image.dataWindow;
  const int halo = denoiseHalo(plan);
  for (int y = window.y0; y < window.y1; y += bandHeight) {
    const int end = std::min(y + bandHeight, window.y1);
    const DeepImage band = denoise(rows(image, std::max(window.y0, y - halo), std::min(window.y1, end + halo)), plan);
    ASSERT_EQ(difference(rows(whole, y, end), rows(band, y, end)), "")
        << "rows " << y << " to " << end << " of " << window.y0 << " to " << window.y1;
  }
}

TEST(Denoise, GivesTheSameBitsForAnyBandOfRows) {
  for (const int y0 : {0, -37, 101})
    for (const int height : {7, 16, 33}) {
      const DeepImage image = renderFrame({.width = 37, .height = 70, .x0 = 3, .y0 = y0, .emission = true}).noisy;
      expectBandsAgree(image, planFor(image), height);
    }
  const DeepImage image = renderFrame({.width = 20, .height = 75, .y0 = -11}).noisy;
  expectBandsAgree(image, planFor(image), 1);
}

TEST(Denoise, GivesTheSameBitsForAnyBandWhateverIsMissing) {
  const std::vector<std::vector<std::string>> missing{
      {"half"}, {"half", "variance"}, {"diffuse", "specular"}, {"half", "variance", "albedo", "N.", "diffuse"}};
  for (const std::vector<std::string>& groups : missing) {
    DeepImage image = renderFrame({.width = 35, .height = 64, .y0 = -3}).noisy;
    for (const std::string& group : groups) dropGroup(image, group);
    for (const Quality quality : {Quality::Fast, Quality::Best}) expectBandsAgree(image, planFor(image, {quality}), 9);
  }
}

TEST(Denoise, GivesTheSameBitsForAnyBandAndThreadsWithPublishedFilters) {
  for (const FilterKind filter : {FilterKind::Paper, FilterKind::Rdfc})
    for (const bool halves : {true, false}) {
      DeepImage image = renderFrame({.width = 20, .height = 140, .y0 = -3}).noisy;
      if (!halves) dropGroup(image, "half");
      const DenoisePlan plan = planFor(image, {.filter = filter});
      ASSERT_LT(denoiseHalo(plan), 60);  // else no band is without the others
      expectBandsAgree(image, plan, 35);
      const DeepImage expected = denoise(image.copy(), plan);
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
      EXPECT_EQ(difference(expected, denoise(image.copy(), plan)), "");
    }
}

TEST(Denoise, GivesTheSameBitsForBandsOfAFrameThatIsMostlyStill) {
  const auto spots = [](int x, int y) { return (x / 5 + y / 5) % 4 == 0 ? 0.8f : 0.0f; };
  const auto lower = [](int, int y) { return y > 40 ? 0.8f : 0.0f; };
  for (const auto& noise : {std::function<float(int, int)>(spots), std::function<float(int, int)>(lower)}) {
    const DeepImage image = renderFrame({.width = 37, .height = 80, .y0 = -9, .noise = noise}).noisy;
    expectBandsAgree(image, planFor(image), 13);
  }
}

TEST(Denoise, ReturnsANoiseFreeFrameUnchanged) {
  const RenderedFrame frame = renderFrame({.emission = true, .noise = [](int, int) { return 0.0f; }});
  DeepImage before = frame.noisy.copy(), after = run(frame.noisy, {.keepStatistics = true});
  EXPECT_EQ(difference(before, after), "");
}

TEST(Denoise, TouchesANoiseFreeHalfOnlyNextToTheNoise) {
  const int half = 40;
  const RenderedFrame frame =
      renderFrame({.width = 80, .height = 40, .noise = [&](int x, int) { return x < half ? 0.7f : 0.0f; }});
  const DenoisePlan plan = planFor(frame.noisy);
  DenoiseStats stats;
  const DeepImage out = denoise(frame.noisy.copy(), plan, {}, &stats);
  EXPECT_LT(binError(out, frame.truth), 0.35 * binError(frame.noisy, frame.truth));
  EXPECT_GT(stats.counts["pixels kept: nothing noisy"], 0u);
  EXPECT_GT(stats.counts["tiles skipped: nothing noisy"], 0u);
  for (const std::string& name : kColours) {
    const auto before = frame.noisy.get(name), after = out.get(name);
    for (int y = 0; y < 40; ++y)
      for (int x = half + denoiseHalo(plan); x < 80; ++x) {
        const size_t pixel = size_t(y) * 80 + size_t(x);
        for (size_t b = out.offsets[pixel]; b < out.offsets[pixel + 1]; ++b)
          ASSERT_TRUE(sameBits(before[b], after[b])) << name << " at " << x << ", " << y;
      }
  }
}

struct Poison {
  const char* channels;
  float value;
};

// Channels whose name starts with one of the given groups (blank-separated) get a value at the bin.
void poison(DeepImage& image, const std::string& groups, size_t bin, float value) {
  size_t found = 0;
  for (size_t at = 0; at < groups.size();) {
    const size_t end = std::min(groups.find(' ', at), groups.size());
    for (Channel& channel : image.channels)
      if (channel.type != PixelType::Uint && channel.name.starts_with(groups.substr(at, end - at))) {
        channel.values[bin] = value;
        ++found;
      }
    at = end + 1;
  }
  ASSERT_GT(found, 0u) << groups;
}

TEST(Denoise, OnePoisonedSampleChangesNothingOutOfReach) {
  const DeepImage clean = renderFrame({.width = 72, .height = 70}).noisy;
  const DenoisePlan plan = planFor(clean);
  const int halo = denoiseHalo(plan);
  const DeepImage expected = denoise(clean.copy(), plan);
  const std::string colours = "R G B diffuse specular half0.diffuse half1.diffuse half0.specular half1.specular";
  const std::vector<std::pair<std::string, float>> poisons{{colours, kNan},
                                                           {colours, kInfinity},
                                                           {colours, 1e20f},
                                                           {colours, 9e14f},
                                                           {colours, -kInfinity},
                                                           {"half0.diffuse", kNan},
                                                           {"R G B", kNan},
                                                           {"diffuse specular R G B", kNan},
                                                           {"albedo", kNan},
                                                           {"half0.albedo", kInfinity},
                                                           {"N.", kNan},
                                                           {"N.", 1e30f},
                                                           {"variance.R", kNan},
                                                           {"variance.R", kInfinity},
                                                           {"variance.N", kNan},
                                                           {"variance.Z", kInfinity},
                                                           {"variance.albedo", 1e30f},
                                                           {"samples", kNan},
                                                           {"half0.samples", kInfinity},
                                                           {"Z", kNan},
                                                           {"Z", kInfinity},
                                                           {"Z", -1.0f},
                                                           {"A", kNan},
                                                           {"half0.R half1.R", kNan}};
  for (const auto& [channels, value] : poisons)
    for (const auto& [x, y] : {std::pair{3, 12}, std::pair{35, 40}, std::pair{71, 69}}) {
      SCOPED_TRACE(channels + " " + std::to_string(value) + " at " + std::to_string(x) + ", " + std::to_string(y));
      DeepImage image = clean.copy();
      poison(image, channels, binAt(image, x, y), value);
      const DeepImage out = denoise(std::move(image), plan);
      expectFinite(out, channels);
      for (const std::string& name : kColours) {
        const auto a = expected.get(name), b = out.get(name);
        for (int py = 0; py < 70; ++py)
          for (int px = 0; px < 72; ++px) {
            if (std::abs(px - x) <= halo && std::abs(py - y) <= halo) continue;
            const size_t pixel = size_t(py) * 72 + size_t(px);
            for (size_t i = out.offsets[pixel]; i < out.offsets[pixel + 1]; ++i)
              ASSERT_TRUE(sameBits(a[i], b[i])) << name << " at " << px << ", " << py;
          }
      }
    }
}

TEST(Denoise, NonFiniteColoursAreCountedAndFilled) {
  for (const float value : {kNan, kInfinity, -kInfinity, 1e20f})
    for (const char* channels : {"diffuse half0.diffuse half1.diffuse R G B half0.R half1.R", "R G B", "diffuse.R"})
      for (const float noise : {0.7f, 0.0f}) {
        const RenderedFrame frame = renderFrame({.noise = [&](int, int) { return noise; }});
        DeepImage image = frame.noisy.copy();
        const size_t bin = binAt(image, 20, 21);
        poison(image, channels, bin, value);
        DenoiseStats stats;
        const DeepImage out = denoise(std::move(image), planFor(frame.noisy), {}, &stats);
        expectFinite(out, channels);
        EXPECT_EQ(stats.counts["non-finite samples"], 1u) << channels << value;
        for (const std::string& rgb : kRgb)
          EXPECT_NEAR(out.get(rgb)[bin], frame.truth.get(rgb)[bin], 0.4f * frame.truth.get(rgb)[bin])
              << channels << value << noise;
      }
}

TEST(Denoise, ANonFiniteAlbedoLeavesTheColour) {
  const RenderedFrame frame = renderFrame();
  for (const float value : {kNan, kInfinity, -kInfinity, 1e30f}) {
    DeepImage image = frame.noisy.copy();
    const size_t bin = binAt(image, 20, 21);
    poison(image, "albedo half0.albedo half1.albedo", bin, value);
    const DeepImage out = run(image, {.gate = false});
    for (const std::string& rgb : kRgb)
      EXPECT_NEAR(out.get(rgb)[bin], frame.noisy.get(rgb)[bin], 0.5f * frame.noisy.get(rgb)[bin]) << value;
  }
}

TEST(Denoise, ANonFiniteEmissionBecomesNothing) {
  DeepImage image = renderFrame({.emission = true}).noisy;
  const size_t bin = binAt(image, 21, 21);
  ASSERT_EQ(image.get("A")[bin], 0);
  poison(image, "R G B diffuse specular half", bin, kNan);
  const DeepImage out = run(image);
  expectFinite(out, "emission");
  EXPECT_EQ(out.get("R")[bin], 0);
}

TEST(Denoise, EmissionAndBinsWithoutSamplesStay) {
  const RenderedFrame frame = renderFrame({.emission = true});
  const DeepImage out = run(frame.noisy);
  const auto alpha = out.get("A");
  size_t glows = 0;
  for (size_t b = 0; b < alpha.size(); ++b) {
    if (alpha[b] > 0) continue;
    ++glows;
    for (const std::string& name : kColours) ASSERT_TRUE(sameBits(out.get(name)[b], frame.noisy.get(name)[b])) << name;
  }
  EXPECT_GT(glows, 100u);
  // The same frame without them gives the others the same colours.
  const DeepImage plain = denoise(renderFrame().noisy, planFor(frame.noisy));
  size_t other = 0;
  for (size_t b = 0; b < alpha.size(); ++b)
    if (alpha[b] > 0) {
      ASSERT_FLOAT_EQ(out.get("R")[b], plain.get("R")[other++]) << b;
    }
}

// A renderer that writes what stands behind an opaque surface: no camera sample saw it, nothing tells what it should
// be, and whoever takes the front away wants it back.
TEST(Denoise, AlphasBeyondOneAreOne) {
  const RenderedFrame frame = renderFrame();
  for (const bool variances : {true, false}) {
    DeepImage image = frame.noisy.copy();
    if (!variances) dropGroup(image, "variance.");
    const DeepImage expected = run(image);
    for (float& alpha : image.get("A"))
      if (alpha == 1) alpha = 1.5f;
    const DeepImage out = run(image);
    for (const std::string& name : kColours)
      for (size_t b = 0; b < out.samples(); ++b) ASSERT_EQ(out.get(name)[b], expected.get(name)[b]) << name;
  }
}

TEST(Denoise, WhatIsHiddenKeepsItsColours) {
  for (const bool counted : {true, false}) {
    DeepImage image = renderFrame().noisy;
    const auto alpha = image.get("A");
    std::vector<size_t> hidden;
    for (size_t p = 0; p < image.pixels(); ++p)
      if (image.count(p) > 1) {
        alpha[image.offsets[p]] = 1;
        for (size_t b = image.offsets[p] + 1; b < image.offsets[p + 1]; ++b) hidden.push_back(b);
      }
    ASSERT_GT(hidden.size(), 100u);
    if (!counted)
      for (const char* group : {"half", "variance", "samples"}) dropGroup(image, group);
    const DeepImage out = run(image);
    for (const std::string& name : kColours)
      for (const size_t b : hidden) ASSERT_TRUE(sameBits(out.get(name)[b], image.get(name)[b])) << name;
  }
}

TEST(Denoise, NegativeColoursKeepTheirMean) {
  // A filter with negative lobes in the renderer: colours around zero.
  RenderedFrame frame = renderFrame({.light = [](int, int) { return 0.2f; }});
  const std::vector<std::string> halves{"", "half0.", "half1."};
  for (const std::string& half : halves)
    for (const std::string& rgb : kRgb) {
      for (const char* group : {"specular.", ""}) {
        const auto value = frame.noisy.get(fmt::format("{}{}{}", half, group, rgb)), alpha = frame.noisy.get("A");
        for (size_t b = 0; b < value.size(); ++b) value[b] -= 0.3f * alpha[b];
      }
    }
  for (const std::string& rgb : kRgb)
    for (const char* group : {"specular.", ""}) {
      const auto value = frame.truth.get(group + rgb), alpha = frame.truth.get("A");
      for (size_t b = 0; b < value.size(); ++b) value[b] -= 0.3f * alpha[b];
    }
  DenoisePlan plan = planFor(frame.noisy);
  const DeepImage out = denoise(frame.noisy.copy(), plan);
  expectFinite(out, "negative");
  EXPECT_LT(flatError(out, frame.truth), 0.35 * flatError(frame.noisy, frame.truth));
}

// The frame seen in a mirror: pixels of a row in the other order, the bins of a pixel in the same.
DeepImage mirror(const DeepImage& image) {
  DeepImage result = image.copy();
  const size_t width = size_t(image.dataWindow.width());
  const auto from = [&](size_t pixel) { return pixel / width * width + (width - 1 - pixel % width); };
  for (size_t p = 0; p < image.pixels(); ++p) result.offsets[p + 1] = result.offsets[p] + image.count(from(p));
  for (size_t c = 0; c < image.channels.size(); ++c)
    for (size_t p = 0; p < image.pixels(); ++p)
      for (size_t i = 0; i < image.count(from(p)); ++i) {
        const size_t to = result.offsets[p] + i, source = image.offsets[from(p)] + i;
        if (image.channels[c].type == PixelType::Uint)
          result.channels[c].ids[to] = image.channels[c].ids[source];
        else
          result.channels[c].values[to] = image.channels[c].values[source];
      }
  return result;
}

TEST(Denoise, AMirroredFrameGivesTheMirroredAnswer) {
  for (const bool gate : {true, false}) {
    const DeepImage image = renderFrame({.width = 45}).noisy;
    EXPECT_LT(farthest(mirror(run(image, {.gate = gate})), run(mirror(image), {.gate = gate})), 1e-4);
  }
}

TEST(Denoise, FollowsTheExposure) {
  const DeepImage image = renderFrame().noisy;
  const DenoisePlan plan = planFor(image);
  const DeepImage expected = denoise(image.copy(), plan);
  for (const float scale : {0x1p10f, 0x1p-10f}) {
    DeepImage scaled = image.copy();
    for (Channel& channel : scaled.channels) {
      const std::string& name = channel.name;
      const bool variance = name == "variance.R" || name == "variance.G" || name == "variance.B";
      const bool colour = name.find("diffuse.") != std::string::npos || name.find("specular.") != std::string::npos ||
                          name == "R" || name == "G" || name == "B" || (name.starts_with("half") && name.size() == 7);
      if (variance || colour)
        for (float& v : channel.values) v *= variance ? scale * scale : scale;
    }
    DenoisePlan scaledPlan = plan;
    scaledPlan.level *= scale;
    DeepImage out = denoise(std::move(scaled), scaledPlan);
    for (const std::string& name : kColours)
      for (float& v : out.get(name)) v /= scale;
    EXPECT_LT(farthest(out, expected), 1e-3) << scale;
  }
}

TEST(Denoise, DegradesWithWhatIsMissing) {
  RenderedFrame frame = renderFrame({.width = 64, .height = 48});
  const double flat = flatError(frame.noisy, frame.truth), bins = binError(frame.noisy, frame.truth);
  DeepImage image = frame.noisy.copy();
  for (const char* group : {"variance.Z", "variance.N", "variance.albedo", "half0.samples", "half0.albedo", "N.",
                            "specular", "samples", "half", "variance", "diffuse", "albedo", "id", "crypto"}) {
    dropGroup(image, group);
    for (const Quality quality : {Quality::Fast, Quality::Balanced}) {
      const DeepImage out = run(image, {quality});
      expectFinite(out, group);
      EXPECT_GT(farthest(out, frame.noisy), 0.01) << "without " << group;
      if (!image.find("albedo.R")) continue;  // nothing is left that tells the texture
      EXPECT_LT(flatError(out, frame.truth), 0.8 * flat) << "without " << group;
      EXPECT_LT(binError(out, frame.truth), 0.8 * bins) << "without " << group;
    }
  }
  EXPECT_EQ(image.channels.size(), 5u);  // R G B A Z
}

TEST(Denoise, TakesWhateverGroupIsMissingAlone) {
  const RenderedFrame frame = renderFrame();
  const double bins = binError(frame.noisy, frame.truth);
  for (const char* group :
       {"half0", "half1.samples", "half", "variance.R", "variance", "samples", "albedo.G", "half1.albedo", "N.X",
        "diffuse", "specular", "half1.specular", "variance.N", "half0.diffuse.R"}) {
    DeepImage image = frame.noisy.copy();
    dropGroup(image, group);
    const DeepImage out = run(image);
    expectFinite(out, group);
    EXPECT_LT(binError(out, frame.truth), 0.8 * bins) << "without " << group;
  }
}

TEST(Denoise, ReadsOnlyWhatItSays) {
  for (const char* missing : {"nothing", "half", "variance", "diffuse", "albedo"}) {
    DeepImage image = renderFrame({.volumes = true}).noisy;
    dropGroup(image, missing);
    const DenoisePlan plan = planFor(image);
    const DeepImage expected = denoise(image.copy(), plan);
    std::erase_if(image.channels, [&](const Channel& c) { return !denoiseReads(plan.inputs, c.name); });
    EXPECT_FALSE(image.find("crypto"));
    EXPECT_EQ(farthest(denoise(std::move(image), plan), expected), 0) << missing;
  }
}

// Scene units do not matter, nor next to pixels that see nothing.
TEST(Denoise, FollowsTheUnitOfDepth) {
  const DeepImage image = renderFrame({.volumes = true, .empty = [](int x, int y) { return (x + y) % 5 == 0; }}).noisy;
  const DenoisePlan plan = planFor(image);
  const DeepImage expected = denoise(image.copy(), plan);
  for (const float scale : {0.1f, 1e3f, 1e6f}) {
    DeepImage scaled = image.copy();
    for (const auto& [channel, power] : {std::pair{"Z", 1}, {"ZBack", 1}, {"variance.Z", 2}})
      for (float& v : scaled.get(channel)) v *= power == 2 ? scale * scale : scale;
    EXPECT_LT(farthest(denoise(std::move(scaled), plan), expected), 1e-3) << scale;
  }
}

// What a skip leaves out, made not worth skipping by something that nobody sees, gives the same.

TEST(DenoiseSkips, EmptyTiles) {
  const DeepImage image = renderFrame({.width = 130, .height = 70, .empty = [](int x, int) { return x >= 20; }}).noisy;
  DeepImage dusty = image.copy();
  dusty.offsets[0] = 0;
  std::vector<bool> dust;
  for (size_t p = 0; p < image.pixels(); ++p) {
    for (size_t i = 0; i < image.count(p); ++i) dust.push_back(false);
    if (p % 130 >= 22) dust.push_back(true);
    dusty.offsets[p + 1] = dust.size();
  }
  for (Channel& channel : dusty.channels) {
    const Channel& from = *image.find(channel.name);
    Channel& to = channel;
    to.values = Buffer<float>(channel.type == PixelType::Uint ? 0 : dust.size());
    to.ids = Buffer<uint32_t>(channel.type == PixelType::Uint ? dust.size() : 0, 0);
    for (size_t i = 0, b = 0; i < to.values.size(); ++i) {
      to.values[i] = dust[i] ? 1e-9f : from.values[b];
      if (dust[i] && channel.name == "A") to.values[i] = 2e-6f;
      if (dust[i] && channel.name == "Z") to.values[i] = 1e3f;
      // One camera sample: its noise is unknown.
      if (dust[i] && channel.name.ends_with("samples")) to.values[i] = channel.name == "half1.samples" ? 0 : 1;
      b += !dust[i];
    }
  }
  const DenoisePlan plan = planFor(image);
  DenoiseStats skipping, filtering;
  const DeepImage a = denoise(image.copy(), plan, {}, &skipping), b = denoise(std::move(dusty), plan, {}, &filtering);
  EXPECT_GT(skipping.counts["tiles skipped: nothing noisy"], 10u);
  EXPECT_EQ(filtering.counts["tiles skipped: nothing noisy"], 0u);
  for (const std::string& name : kColours)
    for (size_t i = 0, at = 0; i < dust.size(); ++i)
      if (!dust[i]) {
        ASSERT_NEAR(b.get(name)[i], a.get(name)[at++], 1e-5) << name;
      }
}

// Not still, since one camera sample each says nothing of its noise, and nothing to filter.
TEST(DenoiseSkips, WhereThereIsNoLightAtAll) {
  DeepImage image = renderFrame({.width = 100, .height = 60}).noisy;
  const int lit = 30;
  for (Channel& channel : image.channels) {
    const bool isColour = std::ranges::any_of(std::vector<std::string>{"R", "G", "B", "diffuse", "specular", "half"},
                                              [&](const auto& name) { return channel.name.starts_with(name); });
    const bool isCount = channel.name.ends_with("samples");
    for (size_t p = 0; p < image.pixels(); ++p)
      for (size_t b = image.offsets[p]; b < image.offsets[p + 1] && p % 100 >= lit && (isColour || isCount); ++b)
        channel.values[b] = isCount && channel.name != "half1.samples" ? 1 : 0;
  }
  for (const Quality quality : {Quality::Fast, Quality::Best}) {
    const DenoisePlan plan = planFor(image, {quality});
    DenoiseStats stats;
    const DeepImage out = denoise(image.copy(), plan, {}, &stats);
    EXPECT_GT(stats.counts["bins skipped"], 1000u);
    for (const std::string& name : kColours)
      for (size_t p = 0; p < image.pixels(); ++p)
        for (size_t b = image.offsets[p]; b < image.offsets[p + 1] && p % 100 >= size_t(lit + denoiseHalo(plan)); ++b)
          ASSERT_EQ(out.get(name)[b], 0) << name << " at " << p % 100 << ", " << p / 100;
  }
}

TEST(DenoiseSkips, AComponentWithoutLight) {
  DeepImage dark = renderFrame().noisy;
  for (Channel& channel : dark.channels)
    if (channel.name.find("specular") != std::string::npos) channel.values.fill(0);
  DeepImage dim = dark.copy();
  for (Channel& channel : dim.channels)
    if (channel.name.find("specular") != std::string::npos) channel.values.fill(1e-12f);
  const DenoisePlan plan = planFor(dark);
  DenoiseStats skipping, filtering;
  const DeepImage a = denoise(std::move(dark), plan, {}, &skipping), b = denoise(std::move(dim), plan, {}, &filtering);
  EXPECT_GT(skipping.counts["tiles where a component has no light"], 0u);
  EXPECT_EQ(filtering.counts["tiles where a component has no light"], 0u);
  EXPECT_LT(farthest(a, b), 1e-6);
}

// The bound: where the halves agree, what is kept is at most 1 % of the mean colour (rms) from what the filter would
// make of it, and nearer to the truth.
TEST(DenoiseSkips, WhatIsStill) {
  const int half = 40;
  const RenderedFrame frame =
      renderFrame({.width = 96, .height = 40, .noise = [&](int x, int) { return x < half ? 0.7f : 0.0f; }});
  const DeepImage& image = frame.noisy;
  DeepImage restless = image.copy();
  const auto alpha = image.get("A");
  for (const std::string& rgb : kRgb) {
    const auto colour = image.get(rgb);
    const auto variance = restless.get("variance." + rgb);
    for (size_t b = 0; b < colour.size(); ++b) variance[b] += std::pow(0.05f * colour[b] / alpha[b], 2.0f);
  }
  const DenoisePlan plan = planFor(image, {.gate = false});
  DenoiseStats skipping, filtering;
  const DeepImage a = denoise(image.copy(), plan, {}, &skipping),
                  b = denoise(std::move(restless), plan, {}, &filtering);
  EXPECT_GT(skipping.counts["pixels kept: nothing noisy"], 1000u);
  EXPECT_EQ(filtering.counts["pixels kept: nothing noisy"], 0u);
  EXPECT_LT(std::sqrt(binError(a, b)), 0.01 * double(plan.level));
  EXPECT_LT(binError(a, frame.truth), binError(b, frame.truth));
}

TEST(Denoise, VolumesAreBinsLikeOthers) {
  const RenderedFrame frame = renderFrame({.volumes = true});
  const DeepImage out = run(frame.noisy);
  EXPECT_LT(binError(out, frame.truth), 0.35 * binError(frame.noisy, frame.truth));
  EXPECT_TRUE(out.find("ZBack"));
}

TEST(Denoise, TinyFramesAreFrames) {
  for (const auto& [width, height] : {std::pair{1, 1}, {2, 1}, {1, 3}, {5, 4}, {0, 0}, {7, 0}}) {
    const DeepImage image = renderFrame({.width = width, .height = height}).noisy;
    const DeepImage out = run(image);
    EXPECT_EQ(out.samples(), image.samples());
    expectFinite(out, "tiny");
  }
  DeepImage empty = renderFrame().noisy;
  for (Channel& channel : empty.channels) {
    channel.values = Buffer<float>(0);
    channel.ids = Buffer<uint32_t>(0);
  }
  empty.offsets.fill(0);
  EXPECT_EQ(run(empty).samples(), 0u);
}

TEST(Denoise, ProgressNeverFallsAndReachesOne) {
  const DeepImage image = renderFrame({.width = 100, .height = 50}).noisy;
  std::vector<double> seen;
  Progress progress;
  progress.report = [&](double done) { seen.push_back(done); };
  denoise(image.copy(), planFor(image), progress);
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_EQ(seen.front(), 0);
  EXPECT_EQ(seen.back(), 1);
  EXPECT_GT(seen.size(), 10u);
}

TEST(Denoise, StopsWhenAsked) {
  const DeepImage image = renderFrame({.width = 100, .height = 50}).noisy;
  for (const double when : {0.0, 0.1, 0.4, 0.85}) {
    std::stop_source source;
    Progress progress;
    progress.stop = source.get_token();
    progress.report = [&](double done) {
      if (done >= when) source.request_stop();
    };
    EXPECT_THROW(denoise(image.copy(), planFor(image), progress), Cancelled) << when;
  }
}

TEST(Denoise, AMissingChannelIsNamed) {
  const DeepImage image = renderFrame().noisy;
  const DenoisePlan plan = planFor(image);
  for (const char* channel : {"half1.specular.G", "albedo.B", "A", "Z", "samples", "variance.N.Y"}) {
    DeepImage without = image.copy();
    without.erase(channel);
    try {
      denoise(std::move(without), plan);
      ADD_FAILURE() << channel;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(channel), std::string::npos) << e.what();
    }
  }
}

}  // namespace
}  // namespace fathom::deep
