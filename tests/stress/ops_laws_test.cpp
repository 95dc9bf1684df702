// Laws that all operations on deep images keep, whatever is in them: what is poisoned spoils its own pixel only and nothing
// there becomes non-finite; shifting, flipping and cutting out first or last is the same; so is scaling all light by a
// power of two; and sums that grow too large end, instead of vanishing.
#include <gtest/gtest.h>

#include <bit>
#include <functional>

#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/ops/compress.h"
#include "deep/ops/crop.h"
#include "deep/ops/expression.h"
#include "deep/ops/fog.h"
#include "deep/ops/grade.h"
#include "deep/ops/holdout.h"
#include "deep/ops/keymix.h"
#include "deep/ops/limit.h"
#include "deep/ops/merge.h"
#include "deep/ops/plus.h"
#include "deep/ops/recolour.h"
#include "deep/ops/transform.h"
#include "deep/tidy.h"
#include "tests/reference/random_deep.h"
#include "tests/stress/frames.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

DeepImage mergedWith(const DeepImage& a, const DeepImage& b) {
  std::vector<DeepImage> both;
  both.push_back(a.copy());
  both.push_back(b.copy());
  return deep::merge(both);
}

flat::Image matteOf(const DeepImage& image, float value) {
  flat::Image matte{image.dataWindow, image.displayWindow, {}, {}};
  for (const char* name : {"R", "G", "B", "A"}) matte.add(name, value);
  return matte;
}

// Of an image and another over the same window, pixel by pixel.
struct Operation {
  std::string name;
  std::function<DeepImage(const DeepImage&, const DeepImage&)> run;
  bool linear = true;  // in the light of both
};
std::vector<Operation> operations() {
  return {
      {"copy", [](const DeepImage& a, const DeepImage&) { return a.copy(); }},
      {"tidy", [](const DeepImage& a, const DeepImage&) { return deep::tidy(a.copy()).image; }},
      {"sort", [](const DeepImage& a, const DeepImage&) { return deep::sortSamples(a.copy()); }},
      {"merge", mergedWith},
      {"clip", [](const DeepImage& a, const DeepImage&) { return deep::clip(a, 2, 9); }},
      {"holdout", [](const DeepImage& a, const DeepImage& b) { return deep::holdout(a.copy(), b); }},
      {"holdout by it", [](const DeepImage& a, const DeepImage& b) { return deep::holdout(b.copy(), a); }},
      {"hard holdout", [](const DeepImage& a, const DeepImage& b) { return deep::hardHoldout(a, b, 0.5); }},
      {"plus", [](const DeepImage& a, const DeepImage& b) { return deep::plus(a.copy(), b.copy()); }},
      {"plus it", [](const DeepImage& a, const DeepImage& b) { return deep::plus(b.copy(), a.copy()); }},
      {"keymix", [](const DeepImage& a, const DeepImage& b) { return deep::keymix(a, b, matteOf(a, 0.25f), "A"); }},
      {"limit", [](const DeepImage& a, const DeepImage&) { return deep::limit(a.copy(), 3); }, false},
      {"compress", [](const DeepImage& a, const DeepImage&) { return deep::compress(a.copy(), {.error = 0.01}); },
       false},
      {"fog",
       [](const DeepImage& a, const DeepImage&) {
         return deep::insertFog(a.copy(), {.near = 1, .far = 9, .density = 1});
       },
       false},
      {"fog applied",
       [](const DeepImage& a, const DeepImage&) {
         return deep::applyFog(a.copy(), {.near = 1, .far = 9, .density = 1});
       },
       false},
      {"grade",
       [](const DeepImage& a, const DeepImage&) {
         return deep::grade(a.copy(), {.gain = {2, 3, 0.5f}, .saturation = 0.3f});
       }},
      {"gamma",
       [](const DeepImage& a, const DeepImage&) {
         return deep::grade(a.copy(), {.gamma = {2, 2.2f, 0.4f}});
       },
       false},
      {"recolour",
       [](const DeepImage& a, const DeepImage&) { return deep::recolour(a.copy(), matteOf(a, 0.5f), {.matte = true}); },
       false},
      {"expression",
       [](const DeepImage& a, const DeepImage&) { return deep::expression(a.copy(), {.set = "R = R*0.5 + G"}); }},
      {"depths moved",
       [](const DeepImage& a, const DeepImage&) { return deep::transform(a.copy(), {.z = 3, .zScale = 2}); }},
  };
}

// Calls body(frame, other, operation) for all of them.
template <class Body>
void forEachOperation(const Body& body) {
  forEachFrame([&](const Frame& frame) {
    const DeepImage other = extremeDeep(frame.params, frame.seed + 5000);
    for (const Operation& operation : operations()) {
      SCOPED_TRACE(operation.name + " of " + frame.name + ", seed " + std::to_string(frame.seed));
      body(frame, other, operation);
      if (::testing::Test::HasFailure()) return;
    }
  });
}

// A pixel's samples, all channels in bits.
std::vector<uint32_t> bitsOf(const DeepImage& image, size_t pixel) {
  std::vector<uint32_t> bits;
  for (const deep::Channel& channel : image.channels)
    for (size_t s = image.offsets[pixel]; s < image.offsets[pixel + 1]; ++s)
      bits.push_back(channel.type == deep::PixelType::Uint ? channel.ids[s]
                                                           : std::bit_cast<uint32_t>(channel.values[s]));
  return bits;
}

// What DATA.md says that these values count as.
DeepImage repaired(DeepImage image) {
  for (const char* name : {"R", "G", "B"})
    for (float& value : image.get(name)) value = std::abs(value) <= 1e15f ? value : 0;
  for (float& alpha : image.get("A")) alpha = alpha > 0 ? std::min(alpha, 1.0f) : 0;
  for (size_t s = 0; s < image.samples(); ++s) {
    float& z = image.get("Z")[s];
    if (std::isnan(z)) z = kInfinity;
    if (!image.find("ZBack")) continue;
    float& zBack = image.get("ZBack")[s];
    if (!(zBack > z) || !std::isfinite(zBack) || !std::isfinite(z)) zBack = z;
  }
  return image;
}

TEST(StressPoison, StaysInItsPixelAndCountsAsNothing) {
  forEachOperation([](const Frame& frame, const DeepImage& other, const Operation& operation) {
    DeepImage poisoned = frame.image.copy();
    const std::vector<bool> hit = poison(poisoned, frame.seed % 2 ? 0.02 : 0.3, frame.seed);
    const DeepImage clean = operation.run(frame.image, other), found = operation.run(poisoned, other);
    for (size_t p = 0; p < hit.size(); ++p)
      EXPECT_TRUE(hit[p] || bitsOf(found, p) == bitsOf(clean, p)) << "pixel " << p;
    const flat::Image flat = deep::flatten(found);
    for (const flat::Plane& plane : flat.planes)
      for (size_t p = 0; p < hit.size() && plane.name != "Z"; ++p)
        EXPECT_LE(std::abs(plane.values[p]), 1e15f) << plane.name << " of pixel " << p;
    if (operation.name == "expression") return;  // reads values as they are
    const flat::Image expected = deep::flatten(operation.run(repaired(poisoned.copy()), other));
    for (const char* name : {"R", "G", "B", "A", "Z", "coc"})
      for (size_t p = 0; p < hit.size(); ++p)
        EXPECT_EQ(flat.get(name).values[p], expected.get(name).values[p]) << name << " of pixel " << p;
  });
}

TEST(StressPlace, CutOutAndMovedFirstOrLastIsTheSame) {
  forEachOperation([](const Frame& frame, const DeepImage& other, const Operation& operation) {
    const Box& window = frame.image.dataWindow;
    const Box part{window.x0 + window.width() / 3, window.y0 + window.height() / 3, window.x1, window.y1};
    const auto moved = [](DeepImage image) { return deep::transform(std::move(image), {.x = -7, .y = 40}); };
    const DeepImage whole = operation.run(frame.image, other);
    EXPECT_EQ(reference::difference(operation.run(deep::crop(frame.image, part), deep::crop(other, part)),
                                    deep::crop(whole, part)),
              "");
    EXPECT_EQ(reference::difference(operation.run(moved(frame.image.copy()), moved(other.copy())), moved(whole.copy())),
              "");
  });
}

// Rows from right to left, and rows from below.
DeepImage flipped(const DeepImage& image) {
  DeepImage result = image.copyLayout();
  const size_t pixels = image.pixels();
  for (size_t p = 0; p < pixels; ++p) result.offsets[p + 1] = result.offsets[p] + image.count(pixels - 1 - p);
  for (const deep::Channel& from : image.channels) {
    deep::Channel& to = result.add(from.name, from.type);
    for (size_t p = 0; p < pixels; ++p)
      for (size_t s = 0; s < image.count(p); ++s) {
        const size_t source = image.offsets[p] + s, target = result.offsets[pixels - 1 - p] + s;
        if (from.type == deep::PixelType::Uint)
          to.ids[target] = from.ids[source];
        else
          to.values[target] = from.values[source];
      }
  }
  return result;
}

TEST(StressPlace, FlippedFirstOrLastIsTheSame) {
  forEachOperation([](const Frame& frame, const DeepImage& other, const Operation& operation) {
    EXPECT_EQ(reference::difference(operation.run(flipped(frame.image), flipped(other)),
                                    flipped(operation.run(frame.image, other))),
              "");
  });
}

// Powers of two change no bit of a mantissa where nothing becomes denormal or too large.
TEST(StressScale, OfAllLightChangesNothingElse) {
  forEachOperation([](const Frame& frame, const DeepImage& other, const Operation& operation) {
    if (!operation.linear || frame.params.values || frame.params.alphas || frame.params.depths)
      return;  // these make denormals
    for (const float scale : {0x1p-60f, 0x1p40f}) {
      const auto scaled = [&](DeepImage image) {
        for (const char* name : {"R", "G", "B"})
          for (float& value : image.get(name)) value *= scale;
        return image;
      };
      EXPECT_EQ(reference::difference(operation.run(scaled(frame.image.copy()), scaled(other.copy())),
                                      scaled(operation.run(frame.image, other))),
                "");
    }
  });
}

// Samples in one place, each as bright as can be: points, volumes, and light without alpha.
TEST(StressLargest, SumsEndThere) {
  const ExtremeParams params{.window = {0, 0, 7, 5}, .most = 6, .empty = 0};
  for (const auto& [clear, back] :
       {std::pair(false, 3.0f), std::pair(true, 3.0f), std::pair(false, 5.0f), std::pair(true, 5.0f)}) {
    DeepImage image = extremeDeep(params, 1), other = extremeDeep(params, 2);
    for (DeepImage* one : {&image, &other}) {
      for (const char* name : {"R", "G", "B"}) std::ranges::fill(one->get(name), 0.9e15f);
      std::ranges::fill(one->get("Z"), 3.0f);
      std::ranges::fill(one->get("ZBack"), back);
      if (clear) std::ranges::fill(one->get("A"), 0.0f);
    }
    for (const Operation& operation : operations()) {
      // These take away, or set other values.
      const auto others = {"expression", "clip", "hard holdout", "gamma", "recolour"};
      if (std::ranges::find(others, operation.name) != others.end()) continue;
      const flat::Image flat = deep::flatten(operation.run(image, other));
      for (size_t p = 0; p < image.pixels(); ++p) {
        EXPECT_LE(flat.get("G").values[p], 1e15f) << operation.name << ", pixel " << p;
        const bool hidden =
            !clear || operation.name == "fog" || operation.name == "fog applied" || operation.name == "keymix";
        EXPECT_GE(flat.get("G").values[p], hidden ? 1e10f : 0.9e15f) << operation.name << ", pixel " << p;
      }
    }
  }
}

}  // namespace
}  // namespace fathom::stress
