// Laws of the deep denoiser with all its filters, gate and guide: averages, exposure, windows, mirrors and parts.
#include <gtest/gtest.h>

#include <functional>

#include "tests/reference/random_deep.h"
#include "tests/reference/rendered_frame.h"
#include "tests/stress/denoise_methods.h"
#include "tests/stress/record.h"

namespace fathom::deep {
namespace {

using reference::renderFrame;
using stress::extremeDeep;
using stress::farthest;
using stress::kMethods;
using stress::Method;
using stress::planOf;
using stress::record;
using stress::run;

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

// But for those that select the better of several filters: where two are as good, rounding selects.
TEST(StressDenoise, FollowsTheExposure) {
  for (const Method& method : kMethods)
    if (method.params.filter == FilterKind::Own) expectScaleLaw(method, stress::kRoundedScales, false);
}

// Where the window lies does not matter: the same bits.
TEST(StressDenoise, FollowsTheWindow) {
  int frames = 0;
  for (const Method& method : kMethods)
    for (const auto& [dx, dy] : {std::pair{1, 0}, {-7, 5}, {100003, -100019}}) {
      const DeepImage image = renderFrame({.width = 37, .height = 23}).noisy;
      DeepImage shifted = image.copy();
      shifted.dataWindow = {image.dataWindow.x0 + dx, image.dataWindow.y0 + dy, image.dataWindow.x1 + dx,
                            image.dataWindow.y1 + dy};
      DeepImage expected = run(image, method), found = run(shifted, method);
      found.dataWindow = image.dataWindow;
      const std::string difference = reference::difference(expected, found);
      EXPECT_EQ(difference, "") << method.name << " " << dx << ", " << dy;
      frames += !difference.empty();
    }
  record("deep denoiser", "windows elsewhere: frames with bits that differ", frames, 1);
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

}  // namespace
}  // namespace fathom::deep
