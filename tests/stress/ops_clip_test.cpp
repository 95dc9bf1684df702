// What lies between two depths, at the ends of the numbers: cuts, views and slices.
#include <gtest/gtest.h>

#include <cfloat>

#include "deep/clip.h"
#include "deep/clip_view.h"
#include "deep/compare.h"
#include "deep/depth_histogram.h"
#include "deep/depth_slice.h"
#include "deep/tidy.h"
#include "tests/stress/curves.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

// As in ops_merge_test.cpp: an alpha, a weight and the light are rounded once each.
constexpr double kPassing = 0x1.1p-24, kLight = 0x1.1p-22;
// Alphas of 1 - 2^-24 are known to half of their last bit, so the optical depth of a part of such a volume only to one
// part in 24; where volumes overlap, that is how much of the light of each is seen in front of the other.
constexpr double kThick = 1 / 24.0;

// Depths to cut at: those of samples, their middles, beyond all.
std::vector<float> planesOf(const DeepImage& image, unsigned seed) {
  std::vector<float> planes = {-kInfinity, 0, kInfinity};
  std::mt19937 random(seed);
  const auto z = image.get("Z");
  for (int i = 0; i < 3 && !z.empty(); ++i) {
    const float a = z[random() % z.size()], b = z[random() % z.size()];
    planes.push_back(a);
    if (std::isfinite(a) && std::isfinite(b)) planes.push_back(a / 2 + b / 2);
  }
  return planes;
}

// The light in front of a plane and behind it, with what passes to it in between, is that of the whole.
void checkClips(const Frame& frame, const DeepImage& image, Worst& light, Worst& passing) {
  light.touch(frame.name), passing.touch(frame.name);
  for (const float plane : planesOf(image, frame.seed)) {
    const DeepImage front = deep::clip(image, -kInfinity, plane), behind = deep::clip(image, plane, kInfinity);
    for (size_t p = 0; p < image.pixels(); ++p) {
      const ExactPixel whole = exactPixel(image, p), near = exactPixel(front, p), far = exactPixel(behind, p);
      const auto values = valuesOf(image, p, "G"), frontValues = valuesOf(front, p, "G"),
                 farValues = valuesOf(behind, p, "G");
      const Real scale = magnitude(values) + Real(FLT_MIN) * Real(values.size()), passed = near.passingAll();
      const auto put = [&](Worst& worst, Real is, Real shouldBe, Real unit) {
        worst.put(frame.name, frame.seed, p, is, shouldBe, unit);
      };
      const bool all = plane == kInfinity;  // what is at infinity is in front of no plane but this
      const Real seen = near.light(frontValues, kForever, true);
      put(light, seen, whole.light(values, all ? kForever : Real(plane), all), scale);
      put(passing, passed, all ? whole.passingAll() : whole.passing(plane), 1);
      if (all) continue;
      put(light, seen + passed * far.light(farValues, kForever, true), whole.light(values, kForever, true), scale);
      put(passing, passed * far.passingAll(), whole.passingAll(), 1);
    }
  }
}

TEST(StressClip, NearOverFarIsTheWhole) {
  Worst light("clip: light, of tidy frames", kLight), passing("clip: transmittance", kPassing);
  forEachFrame([&](const Frame& frame) { checkClips(frame, deep::tidy(frame.image.copy()).image, light, passing); });
}

TEST(StressClip, OfOverlappingVolumes) {
  Worst light("clip: light, volumes overlap", kThick), passing("clip: transmittance, volumes overlap", 0x1.1p-22);
  forEachFrame([&](const Frame& frame) { checkClips(frame, frame.image, light, passing); });
}

TEST(StressClip, ByAMapIsByThePlaneOfEachPixel) {
  forEachFrame([](const Frame& frame) {
    flat::Image map{frame.image.dataWindow, frame.image.displayWindow, {}, {}};
    const std::vector<float> planes = planesOf(frame.image, frame.seed);
    Buffer<float>& depth = map.add("Z").values;
    for (size_t p = 0; p < depth.size(); ++p) depth[p] = planes[p % planes.size()];
    const DeepImage front = deep::clipByMap(frame.image, map, "Z", deep::Side::Front);
    const DeepImage behind = deep::clipByMap(frame.image, map, "Z", deep::Side::Behind);
    for (size_t k = 0; k < planes.size(); ++k) {
      const DeepImage near = deep::clip(frame.image, -kInfinity, planes[k]);
      const DeepImage far = deep::clip(frame.image, planes[k], kInfinity);
      for (size_t p = k; p < depth.size(); p += planes.size())
        for (const char* name : {"G", "A", "Z", "coc"}) {
          EXPECT_TRUE(std::ranges::equal(valuesOf(front, p, name), valuesOf(near, p, name))) << frame.name << p;
          EXPECT_TRUE(std::ranges::equal(valuesOf(behind, p, name), valuesOf(far, p, name))) << frame.name << p;
        }
    }
  });
}

// What a range with soft ends leaves, in long double.
class SoftRange {
 public:
  explicit SoftRange(const deep::DepthRange& range) : range_(range) {
    ramp_ = std::min(Real(range.soft), (Real(range.far) - Real(range.near)) / 2);
  }
  Real fadeAt(Real z) const {
    const Real in = ramp_ > 0 ? std::min((z - Real(range_.near)) / ramp_, (Real(range_.far) - z) / ramp_) : 1;
    const Real fade = z >= Real(range_.near) && z < Real(range_.far) ? std::clamp(in, Real(0), Real(1)) : 0;
    return range_.inverted ? 1 - fade : fade;
  }
  // Over the linear pieces of the fade, each the mean of what it is near its two ends.
  Real integral(Real from, Real to) const {
    std::vector<Real> knots = {from, to};
    for (const Real knot : {Real(range_.near), Real(range_.near) + ramp_, Real(range_.far) - ramp_, Real(range_.far)})
      if (knot > from && knot < to) knots.push_back(knot);
    std::sort(knots.begin(), knots.end());
    Real sum = 0;
    for (size_t i = 0; i + 1 < knots.size(); ++i)
      sum += (knots[i + 1] - knots[i]) * fadeAt(knots[i] / 2 + knots[i + 1] / 2);
    return sum;
  }
  // Where of [from, to) something may be left.
  std::vector<std::pair<Real, Real>> parts(Real from, Real to) const {
    const Real near = range_.near, far = range_.far;
    if (!range_.inverted) return {{std::max(from, near), std::min(to, far)}};
    return {{from, std::min(to, near + ramp_)}, {std::max(from, far - ramp_), to}};
  }

 private:
  deep::DepthRange range_;
  Real ramp_;
};

// The samples of a pixel as a range leaves them: media, and their premultiplied values.
struct Left {
  std::vector<Medium> media;
  std::vector<Real> values;

  // Parts are samples: their alphas are floats. See kThick for what that means.
  void add(Medium medium, Real alpha, Real value) {
    medium.alpha = float(alpha);
    medium.depth = -std::log1p(-medium.alpha);
    media.push_back(medium), values.push_back(value);
  }
};
Left leftOf(const DeepImage& image, size_t pixel, const deep::DepthRange& range) {
  const SoftRange soft(range);
  const auto values = valuesOf(image, pixel, "G");
  const std::vector<Medium> media = mediaOf(image, pixel);
  Left left;
  for (size_t i = 0; i < media.size(); ++i) {
    Medium medium = media[i];
    if (medium.isPoint()) {
      const Real fade = std::isfinite(medium.z) ? soft.fadeAt(medium.z) : Real(range.inverted);
      if (fade > 0) left.add(medium, medium.alpha * fade, fade * usable(values[i]));
      continue;
    }
    for (const auto& [from, to] : soft.parts(media[i].z, media[i].zBack)) {
      if (!(from < to)) continue;
      const Real inside = soft.integral(from, to), fade = inside / (to - from);
      const Real depth = media[i].depth * inside / (media[i].zBack - media[i].z);
      medium.z = float(from), medium.zBack = float(to);
      if (media[i].alpha == 1)
        left.add(medium, fade, fade * usable(values[i]));
      else
        left.add(medium, -std::expm1(-depth),
                 usable(values[i]) * inside / (media[i].zBack - media[i].z) * meanPassing(depth) /
                     meanPassing(media[i].depth));
    }
  }
  return left;
}

TEST(StressClipView, ShowsWhatTheRangeLeaves) {
  Worst light("clip view: light", 0x1.1p-23), alpha("clip view: alpha", 0x1.1p-24);  // weights are floats, too
  forEachFrame([&](const Frame& frame) {
    light.touch(frame.name), alpha.touch(frame.name);
    std::mt19937 random(frame.seed);
    for (int draw = 0; draw < 6; ++draw) {
      const float near = std::pow(10.0f, float(random() % 8) - 4), length = std::pow(10.0f, float(random() % 8) - 4);
      const deep::DepthRange range{near, near + length, draw % 2 ? length * 0.3f : 0, draw % 3 == 0};
      const flat::Image view = deep::clipView(frame.image, frame.image.dataWindow, 1, range, {"G"});
      for (size_t p = 0; p < frame.image.pixels(); ++p) {
        const Left left = leftOf(frame.image, p, range);
        const ExactPixel exact(left.media);
        const std::vector<Real> factors = exact.factors();
        Real sum = 0;
        for (size_t i = 0; i < factors.size(); ++i) sum += factors[i] * left.values[i];
        light.put(frame.name, frame.seed, p, view.get("G").values[p], sum, magnitude(valuesOf(frame.image, p, "G")));
        alpha.put(frame.name, frame.seed, p, view.get("A").values[p], exact.alphaOfAll());
      }
    }
  });
}

TEST(StressDepthSlice, CellsCompositedAreThePixel) {
  Worst light("depth slice: light", kLight);
  forEachFrame([&](const Frame& frame) {
    light.touch(frame.name);
    const Box& window = frame.image.dataWindow;
    for (const bool logarithmic : {false, true})
      for (int y = window.y0; y < window.y1; ++y) {
        const deep::DepthExtent extent = deep::depthExtent(frame.image, y);
        const deep::DepthAxis axis = deep::axisAround(extent.nearest, extent.farthest, logarithmic);
        const std::vector<float> planes = deep::cellPlanes(axis, 13);
        const flat::Image slice = deep::depthSlice(frame.image, y, window.x0, window.x1, axis, 13, {"G"});
        for (int x = window.x0; x < window.x1; ++x) {
          const size_t p = window.index(x, y);
          const ExactPixel exact = exactPixel(frame.image, p);
          const auto values = valuesOf(frame.image, p, "G");
          const Real scale = magnitude(values) + 13 * Real(FLT_MIN);
          Real seen = 0, passed = 1;
          for (int cell = 0; cell < 13; ++cell) {
            const size_t at = slice.dataWindow.index(x, cell);
            seen += passed * Real(slice.get("G").values[at]);
            passed *= 1 - Real(slice.get("A").values[at]);
            light.put(frame.name, frame.seed, p, seen, exact.light(values, planes[size_t(cell) + 1], false), scale);
          }
        }
      }
  });
}

TEST(StressHistogram, SpreadsWhatIsSeen) {
  constexpr int kBins = 17;
  Worst seen("depth histogram", 1e-12);  // double, from the edges on
  forEachFrame([&](const Frame& frame) {
    seen.touch(frame.name);
    const deep::DepthAxis axis = deep::axisOf(frame.image, frame.seed % 2);
    const std::vector<double> found = deep::depthHistogram(frame.image, axis, kBins, deep::DepthWeight::Seen);
    std::vector<Real> edges, expected(kBins, 0);
    for (int i = 0; i <= kBins; ++i)
      edges.push_back(i == kBins ? axis.far : i == 0 ? axis.near : axis.depth(double(i) / kBins));
    Real total = 1;
    for (size_t p = 0; p < frame.image.pixels(); ++p) {
      const ExactPixel exact = exactPixel(frame.image, p);
      const std::vector<Real> alphas = exact.seen();
      for (size_t s = 0; s < alphas.size(); ++s) {
        const Medium& medium = exact.media()[s];
        total += alphas[s];
        for (size_t i = 0; i < kBins; ++i) {
          if (medium.isPoint())
            expected[i] +=
                medium.z >= edges[i] && (medium.z < edges[i + 1] || (i + 1 == kBins && medium.z == edges[kBins]))
                    ? alphas[s]
                    : 0;
          else if (const Real inside = std::min(medium.zBack, edges[i + 1]) - std::max(medium.z, edges[i]); inside > 0)
            expected[i] += alphas[s] * inside / (medium.zBack - medium.z);
        }
      }
    }
    for (size_t i = 0; i < kBins; ++i) seen.put(frame.name, frame.seed, i, found[i], expected[i], total);
  });
}

TEST(StressVisiblePart, IsWhatLiesBetweenThePlanes) {
  Worst light("compare: visible part", 0x1.1p-24);
  forEachFrame([&](const Frame& frame) {
    const DeepImage image = deep::tidy(frame.image.copy()).image;  // as `compare` is told
    light.touch(frame.name);
    for (const float plane : planesOf(image, frame.seed)) {
      const flat::Image front = deep::visiblePart(image, -kInfinity, plane), behind = deep::visiblePart(image, plane);
      for (size_t p = 0; p < image.pixels(); ++p) {
        const ExactPixel exact = exactPixel(image, p);
        const auto values = valuesOf(image, p, "G");
        const bool all = plane == kInfinity;
        const Real seen = exact.light(values, all ? kForever : Real(plane), all);
        light.put(frame.name, frame.seed, p, front.get("G").values[p], seen, magnitude(values));
        if (!all)
          light.put(frame.name, frame.seed, p, behind.get("G").values[p], exact.light(values, kForever, true) - seen,
                    magnitude(values));
      }
    }
  });
}

}  // namespace
}  // namespace fathom::stress
