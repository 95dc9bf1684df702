// Laws of the deep denoiser with all its filters, gate and guide, on frames of any shape and of values at the ends of what
// files hold.
#include <gtest/gtest.h>

#include <functional>

#include "deep/base_guide.h"
#include "deep/denoise.h"
#include "deep/flat_nl_means.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/rendered_frame.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::deep {
namespace {

using reference::renderFrame;
using stress::extremeDeep;
using stress::ExtremeParams;
using stress::record;

// A way to denoise bins.
struct Method {
  const char* name;
  DenoiseParams params;
  bool guided = false;
};

const std::vector<Method> kMethods{{"own", {}},
                                   {"own, fast, no gate", {.quality = Quality::Fast, .gate = false}},
                                   {"own, best", {.quality = Quality::Best}},
                                   {"own, guided", {}, true},
                                   {"paper", {.filter = FilterKind::Paper}},
                                   {"rdfc", {.filter = FilterKind::Rdfc}}};

DenoisePlan planOf(const DeepImage& image, const Method& method) {
  DenoisePlan plan = stress::planFor(image, method.params);
  plan.guided = method.guided;
  return plan;
}

// With the plan of another frame, so that what is absolute stays.
DeepImage run(const DeepImage& image, const DenoisePlan& plan) {
  if (!plan.guided) return denoise(image.copy(), plan);
  const GuideDenoisers denoisers{flatNlMeans(planFlattened(plan)), reference::boxDenoiser(), kOwnGuide};
  const BaseGuide guide = makeGuide(guideInput(image, plan.inputs, true), denoisers, plan.level);
  return denoise(image.copy(), plan, {}, nullptr, &guide);
}

DeepImage run(const DeepImage& image, const Method& method) {
  return run(image, planOf(image, method));
}

bool isLight(const std::string& name) {
  return stress::factorOf(name, 2) == 2 && !name.starts_with("half");
}

void expectFinite(const DeepImage& image) {
  for (const Channel& channel : image.channels) {
    if (!isLight(channel.name)) continue;
    for (const float v : channel.values) ASSERT_TRUE(std::isfinite(v)) << channel.name << " " << v;
  }
}

// The largest difference of light (not premultiplied, of bins that are seen) relative to its value, or to a hundredth of the
// frame's level where that is more.
double farthest(const DeepImage& a, const DeepImage& b, float level, double scale = 1) {
  double worst = 0;
  const auto alpha = a.get("A");
  for (const Channel& channel : a.channels) {
    if (!isLight(channel.name)) continue;
    const auto x = a.get(channel.name), y = b.get(channel.name);
    EXPECT_EQ(x.size(), y.size());
    for (size_t i = 0; i < x.size(); ++i) {
      if (!(alpha[i] > 1e-4f)) continue;
      const double p = double(x[i]) / double(alpha[i]), q = double(y[i]) / scale / double(alpha[i]);
      worst = std::max(worst, std::fabs(p - q) / std::max(std::fabs(p), 0.01 * double(level)));
    }
  }
  return worst;
}

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

// An average lies between what it is of. Without albedo and gate, bins are one.
TEST(StressDenoise, ValuesStayBetweenThoseOfTheFrame) {
  constexpr double kBound = 1e-5;  // sums of some hundred values in floats
  double worst = 0;
  for (int round = 0; round < 2 * stress::rounds(); ++round)
    for (const Method& method : kMethods) {
      if (method.params.gate && method.params.filter == FilterKind::Own) continue;
      const DeepImage image = extremeDeep(
          {.seed = unsigned(round), .mostBins = 2, .largest = 6e4f, .components = false, .features = false});
      const DenoisePlan plan = planOf(image, method);
      const DeepImage out = run(image, plan);
      const auto alpha = image.get("A");
      for (const std::string rgb : {"R", "G", "B"}) {
        double least = 1e30, most = -1e30;
        for (const char* half : {"half0.", "half1.", ""})
          for (size_t i = 0; i < alpha.size(); ++i) {
            if (!(alpha[i] > 0)) continue;
            const double v = double(image.get(half + rgb)[i]) / double(alpha[i]);
            least = std::min(least, v);
            most = std::max(most, v);
          }
        for (size_t i = 0; i < alpha.size(); ++i) {
          if (!(alpha[i] > 0)) continue;
          const double v = double(out.get(rgb)[i]) / double(alpha[i]);
          worst = std::max(worst, (v - most) / most);
          worst = std::max(worst, (least - v) / most);
        }
      }
    }
  record("deep denoiser", "averages beyond what they are of", worst, kBound);
  EXPECT_LT(worst, kBound);
}

// c x denoised is c times x denoised. `exact` scales are powers of two: all but what does not scale is the same then.
void expectScaleLaw(const Method& method, std::span<const float> scales, bool exact) {
  double worst = 0;
  const double bound = exact ? 1e-6 : 1e-4;
  for (int round = 0; round < stress::rounds(); ++round) {
    const DeepImage image =
        renderFrame({.width = 30, .height = 22, .seed = unsigned(round + 1), .volumes = true, .emission = true}).noisy;
    for (const bool halves : {true, false}) {
      DeepImage part = image.copy();
      if (!halves) std::erase_if(part.channels, [](const Channel& c) { return c.name.starts_with("half"); });
      const DenoisePlan plan = planOf(part, method);
      const DeepImage expected = run(part, plan);
      for (const float scale : scales) {
        const DeepImage bright = stress::scaled(part, scale);
        const double far = farthest(expected, run(bright, method), plan.level, double(scale));
        EXPECT_LT(far, bound) << method.name << ", " << scale << (halves ? "" : ", without halves");
        worst = std::max(worst, far);
      }
    }
  }
  record(std::string("deep denoiser, ") + method.name,
         exact ? "exposure over 12 powers of ten, as powers of two" : "exposure over 12 powers of ten", worst, bound);
}

TEST(StressDenoise, FollowsTheExposureExactly) {
  for (const Method& method : kMethods) expectScaleLaw(method, stress::kExactScales, true);
}

TEST(StressDenoise, FollowsTheExposure) {
  for (const Method& method : kMethods) expectScaleLaw(method, stress::kRoundedScales, false);
}

// Where the window lies does not matter: the same bits.
TEST(StressDenoise, FollowsTheWindow) {
  for (const Method& method : kMethods)
    for (const auto& [dx, dy] : {std::pair{1, 0}, {-7, 5}, {100003, -100019}}) {
      const DeepImage image = renderFrame({.width = 37, .height = 23}).noisy;
      DeepImage shifted = image.copy();
      shifted.dataWindow = {image.dataWindow.x0 + dx, image.dataWindow.y0 + dy, image.dataWindow.x1 + dx,
                            image.dataWindow.y1 + dy};
      DeepImage expected = run(image, method), found = run(shifted, method);
      found.dataWindow = image.dataWindow;
      EXPECT_EQ(reference::difference(expected, found), "") << method.name << " " << dx << ", " << dy;
    }
  record("deep denoiser", "windows elsewhere: bits that differ", 0, 1e-30);
}

// The pixels of a frame in another order: those of `from(x, y)`, bins in the order they had.
DeepImage moved(const DeepImage& image, int width, int height,
                const std::function<std::pair<int, int>(int, int)>& from) {
  DeepImage result = image.copyLayout();
  const Box& box = image.dataWindow;
  result.dataWindow = {box.x0, box.y0, box.x0 + width, box.y0 + height};
  result.offsets = Buffer<uint64_t>(result.pixels() + 1, uint64_t(0));
  std::vector<size_t> source;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto [fx, fy] = from(x, y);
      const size_t pixel = size_t(fy) * size_t(box.width()) + size_t(fx);
      for (uint64_t b = image.offsets[pixel]; b < image.offsets[pixel + 1]; ++b) source.push_back(size_t(b));
      result.offsets[size_t(y) * size_t(width) + size_t(x) + 1] = source.size();
    }
  for (const Channel& channel : image.channels) {
    Channel& to = result.add(channel.name, channel.type);
    for (size_t i = 0; i < source.size(); ++i) {
      if (channel.type == PixelType::Uint)
        to.ids[i] = channel.ids[source[i]];
      else
        to.values[i] = channel.values[source[i]];
    }
  }
  return result;
}

// Mirrored both ways and turned: sums run in another order, and weights that are nearly nothing amplify their rounding.
TEST(StressDenoise, FollowsMirrorsAndTurns) {
  constexpr double kBound = 1e-4;
  double worst = 0;
  for (const Method& method : kMethods) {
    const DeepImage image = renderFrame({.width = 33, .height = 26}).noisy;
    const DenoisePlan plan = planOf(image, method);
    const DeepImage expected = run(image, plan);
    const int w = 33, h = 26;
    const auto look = [&](int width, int height, const std::function<std::pair<int, int>(int, int)>& from) {
      const double far =
          farthest(moved(expected, width, height, from), run(moved(image, width, height, from), plan), plan.level);
      EXPECT_LT(far, kBound) << method.name << " " << width;
      worst = std::max(worst, far);
    };
    look(w, h, [&](int x, int y) { return std::pair{w - 1 - x, y}; });
    look(w, h, [&](int x, int y) { return std::pair{x, h - 1 - y}; });
    look(h, w, [&](int x, int y) { return std::pair{y, x}; });
  }
  record("deep denoiser", "mirrors and turns", worst, kBound);
}

// A part of a frame with the filter's reach around it is denoised as it is in the whole: to the last bits, since a row's bins
// lie elsewhere in vectors.
TEST(StressDenoise, APartIsDenoisedAsTheWhole) {
  for (const Method& method : kMethods)
    for (const bool lying : {true, false}) {
      const int length = 150;
      const DeepImage image = renderFrame({.width = lying ? length : 5, .height = lying ? 5 : length}).noisy;
      const DenoisePlan plan = planOf(image, method);
      const int halo = denoiseHalo(plan), first = 20, size = 9, end = std::min(length, first + size + halo);
      const DeepImage whole = run(image, plan);
      const int from = std::max(0, first - halo);
      const auto cut = [&](const DeepImage& of, int begin, int stop) {
        return moved(of, lying ? stop - begin : 5, lying ? 5 : stop - begin, [&](int x, int y) {
          return lying ? std::pair{x + begin, y} : std::pair{x, y + begin};
        });
      };
      const DeepImage part = run(cut(image, from, end), plan);
      const double far =
          farthest(cut(whole, first, first + size), cut(part, first - from, first - from + size), plan.level);
      EXPECT_LT(far, 1e-6) << method.name << (lying ? " lying" : " standing") << ", halo " << halo;
      record("deep denoiser", "parts with the filter's reach", far, 1e-6);
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
        std::string told = std::string(method.name) + " at " + std::to_string(at);
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
          told += ", " + start + (all ? "* " : " ") + std::to_string(value);
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
