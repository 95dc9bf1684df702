// The deep denoiser with all its filters, gate and guide on frames of any shape, values and counts, and on poisoned ones.
#include <gtest/gtest.h>

#include "tests/reference/random_deep.h"
#include "tests/reference/rendered_frame.h"
#include "tests/stress/denoise_methods.h"
#include "tests/stress/record.h"

namespace fathom::deep {
namespace {

using reference::renderFrame;
using stress::expectFinite;
using stress::extremeDeep;
using stress::farthest;
using stress::isLight;
using stress::kMethods;
using stress::Method;
using stress::planOf;
using stress::record;
using stress::run;

constexpr std::pair<int, int> kShapes[] = {{1, 1}, {1, 29}, {37, 1}, {2, 3}, {24, 17}};

TEST(StressDenoise, AnyFrameGivesFiniteColoursAndKeepsTheRest) {
  for (int round = 0; round < stress::rounds(); ++round)
    for (const Method& method : kMethods)
      for (const auto& [width, height] : kShapes)
        for (const float largest : {6e4f, 9e14f})
          for (const double empty : {0.1, 0.97, 1.0})
            for (const bool all : {true, false}) {
              SCOPED_TRACE(testing::Message() << method.name << ", " << width << "x" << height << " to " << largest
                                              << ", empty " << empty << ", round " << round);
              const DeepImage image = extremeDeep({.width = width,
                                                   .height = height,
                                                   .seed = unsigned(31 * round + width),
                                                   .empty = empty,
                                                   .largest = largest,
                                                   .components = all,
                                                   .features = all});
              DeepImage before = image.copy(), after = run(image, method);
              expectFinite(after);
              for (const Channel& channel : image.channels)
                if (isLight(channel.name) || !after.find(channel.name))
                  before.erase(channel.name), after.erase(channel.name);
              ASSERT_EQ(reference::difference(before, after), "");
            }
}

// Random poison in random channels of up to three bins.
TEST(StressDenoise, PoisonStaysWithinReach) {
  constexpr float kPoisons[] = {stress::kNan, stress::kInfinity, -stress::kInfinity, -1, -1e10f, 1e20f, 9e14f, -9e14f,
                                1e-42f};
  const int length = 160;
  for (const Method& method : kMethods)
    for (const bool lying : {true, false}) {
      const DeepImage clean =
          renderFrame({.width = lying ? length : 4, .height = lying ? 4 : length, .volumes = true, .emission = true})
              .noisy;
      const DenoisePlan plan = planOf(clean, method);
      const int halo = denoiseHalo(plan);
      const DeepImage expected = run(clean, plan);
      stress::Draw draw(7);
      for (int round = 0; round < 25 * stress::rounds(); ++round) {
        DeepImage image = clean.copy();
        const int at = int(draw.below(unsigned(length)));
        std::string told = fmt::format("{} at {}", method.name, at);
        for (unsigned times = 1 + draw.below(3); times > 0; --times) {
          const int x = lying ? at : int(draw.below(4)), y = lying ? int(draw.below(4)) : at;
          const size_t pixel = size_t(y) * size_t(clean.dataWindow.width()) + size_t(x);
          if (image.count(pixel) == 0) continue;
          const size_t bin = size_t(image.offsets[pixel]) + draw.below(unsigned(image.count(pixel)));
          const float value = kPoisons[draw.below(unsigned(std::size(kPoisons)))];
          const bool all = draw.below(4) == 0;  // of what begins alike
          const std::string name = image.channels[draw.below(unsigned(image.channels.size()))].name;
          const std::string start = all ? name.substr(0, name.find('.')) : name;
          for (Channel& channel : image.channels)
            if (channel.type != PixelType::Uint && channel.name.starts_with(start)) channel.values[bin] = value;
          told += fmt::format(", {}{} {}", start, all ? "*" : "", value);
        }
        SCOPED_TRACE(told);
        const DeepImage out = run(image, plan);
        expectFinite(out);
        for (const Channel& channel : expected.channels) {
          if (!isLight(channel.name)) continue;
          const auto a = expected.get(channel.name), b = out.get(channel.name);
          for (size_t p = 0; p < out.pixels(); ++p) {
            const int place = int(lying ? p % size_t(length) : p / 4);
            if (std::abs(place - at) <= halo) continue;
            for (uint64_t i = out.offsets[p]; i < out.offsets[p + 1]; ++i)
              ASSERT_TRUE(stress::sameBits(a[i], b[i])) << channel.name << " at " << place << ", halo " << halo;
          }
        }
      }
    }
}

// All that a bin can claim at once.
TEST(StressDenoise, HugeCountsAndVariancesTogetherStayFinite) {
  for (const Method& method : kMethods)
    for (const float light : {0.5f, 9e14f}) {
      DeepImage image = renderFrame({.width = 20, .height = 16}).noisy;
      const DenoisePlan plan = planOf(image, method);
      for (const size_t pixel : {150U, 151U, 210U}) {
        const size_t bin = size_t(image.offsets[pixel]);
        for (Channel& channel : image.channels) {
          if (channel.name.starts_with("variance.") || channel.name.ends_with("samples")) channel.values[bin] = 9e14f;
          if (stress::factorOf(channel.name, 2) == 2) channel.values[bin] = light;
        }
      }
      SCOPED_TRACE(method.name);
      expectFinite(run(image, plan));
    }
}

// Halves of 0, 1 and very different counts, and pixels of 10,000 samples: nothing is lost and nothing made up.
TEST(StressDenoise, HalvesOfAnyCountsKeepTheLight) {
  constexpr double kBound = 1e-5;
  double worst = 0;
  for (const Method& method : kMethods)
    for (const auto& [n, n0] :
         {std::pair{2, 0}, {2, 1}, {2, 2}, {10000, 1}, {10000, 9999}, {10000, 0}, {10000, 5000}}) {
      // Flattened halves are of half of a pixel's samples each: more or fewer are noise of the pixel's.
      if (method.guided && 2 * n0 != n) continue;
      DeepImage image = renderFrame({.width = 20, .height = 14, .empty = [](int, int) { return false; }}).noisy;
      const auto all = image.get("samples"), first = image.get("half0.samples"), second = image.get("half1.samples");
      for (size_t i = 0; i < all.size(); ++i) all[i] = float(n), first[i] = float(n0), second[i] = float(n - n0);
      const auto alpha = image.get("A");
      for (Channel& channel : image.channels) {
        const std::string& name = channel.name;
        const bool silent = (n0 == 0 && name.starts_with("half0.")) || (n0 == n && name.starts_with("half1."));
        const bool whole = name.size() == 1 || name.size() == 7;  // R, half0.R
        const bool albedo = name.find("albedo.") != std::string::npos && !name.starts_with("variance.");
        if (stress::factorOf(name, 2) == 4) channel.values.fill(1e-2f);  // so that nothing is skipped
        const float value = stress::factorOf(name, 2) == 2 ? whole ? 0.5f : 0.25f : 0.4f;
        for (size_t i = 0; i < all.size() && (albedo || stress::factorOf(name, 2) == 2); ++i)
          channel.values[i] = silent ? 0 : value * alpha[i];
      }
      const DenoisePlan plan = planOf(image, method);
      const double far = farthest(image, run(image, plan), plan.level);
      EXPECT_LT(far, kBound) << method.name << ", " << n0 << " of " << n;
      worst = std::max(worst, far);
    }
  record("deep denoiser", "even light, halves of 0, 1 and very different counts, 10,000 samples", worst, kBound);
}

}  // namespace
}  // namespace fathom::deep
