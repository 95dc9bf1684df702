// Fog from none to a wall, over lengths from 1e-6 to 1e9.
#include <gtest/gtest.h>

#include "deep/flatten.h"
#include "deep/ops/fog.h"
#include "tests/stress/curves.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

std::vector<deep::FogParams> fogsOf(const Frame& frame) {
  std::vector<deep::FogParams> fogs;
  for (const double optical : {0.0, 1e-30, 1e-7, 0.5, 3.0, 20.0, 100.0, 1e6}) {
    std::mt19937 random(frame.seed);
    deep::FogParams fog{.near = 0.5f, .far = float(1 + random() % 20), .colour = {0.5f, 0.25f, 1}};
    if (frame.params.depths) fog.near = std::pow(10.0f, float(random() % 15) - 6), fog.far = fog.near * 1000;
    fog.density = optical / (fog.far - fog.near);
    fogs.push_back(fog);
  }
  return fogs;
}

// The samples of a pixel and a fog of exact extinction; the fog's values are those of G.
ExactPixel withFog(const DeepImage& image, size_t pixel, const deep::FogParams& fog, std::vector<float>& values) {
  std::vector<Medium> media = mediaOf(image, pixel);
  const auto own = valuesOf(image, pixel, "G");
  values.assign(own.begin(), own.end());
  media.emplace_back(float(fog.near), float(fog.far), 0.0f);
  media.back().depth = Real(fog.density) * (Real(fog.far) - Real(fog.near));
  media.back().alpha = -std::expm1(-media.back().depth);
  if (media.back().alpha == 1) media.back().alpha = std::nextafter(Real(1), Real(0));  // thick, but no surface
  values.push_back(float(fog.colour[1]));
  return ExactPixel(std::move(media));
}
// Of what is seen: the fog's own value is premultiplied by its alpha.
Real lightOf(const ExactPixel& exact, const std::vector<float>& values, Real until, bool all) {
  const std::vector<Real> factors = exact.factors(until, all);
  Real sum = 0;
  for (size_t i = 0; i + 1 < factors.size(); ++i) sum += factors[i] * usable(values[i]);
  return sum + factors.back() * exact.media().back().alpha * values.back();
}

// A volume of the fog lets through what its FLOAT alpha says: off by 2^-25, which inside of it is more, by the
// inverse of what passes; no volume is thicker than 4. What it hides of the light behind is off as much.
constexpr double kVolumes = 0x1p-22;

TEST(StressFog, InsertedIsSeenAsItIs) {
  Worst light("fog: inserted, light", kVolumes), passing("fog: inserted, transmittance", kVolumes);
  forEachFrame([&](const Frame& frame) {
    light.touch(frame.name), passing.touch(frame.name);
    for (const deep::FogParams& fog : fogsOf(frame)) {
      const DeepImage found = deep::insertFog(frame.image.copy(), fog);
      for (size_t p = 0; p < frame.image.pixels(); ++p) {
        std::vector<float> values;
        const ExactPixel exact = withFog(frame.image, p, fog, values);
        compareCurves(
            {frame, p}, exactPixel(found, p), valuesOf(found, p, "G"), magnitude(values),
            [&](Real until, bool all) { return lightOf(exact, values, until, all); },
            [&](Real until) { return exact.passing(until); }, light, passing);
      }
    }
  });
}

TEST(StressFog, AppliedIsSeenAsItIs) {
  Worst light("fog: applied, light", 0x1.1p-22), alpha("fog: applied, alpha", 0x1.1p-23);  // few roundings
  forEachFrame([&](const Frame& frame) {
    light.touch(frame.name), alpha.touch(frame.name);
    for (const deep::FogParams& fog : fogsOf(frame)) {
      const DeepImage found = deep::applyFog(frame.image.copy(), fog);
      for (size_t p = 0; p < frame.image.pixels(); ++p) {
        // What is at infinity shares its place with the point that stands for the fog.
        if (std::ranges::any_of(valuesOf(frame.image, p, "Z"), [](float z) { return std::isinf(z); })) continue;
        std::vector<float> values;
        const ExactPixel exact = withFog(frame.image, p, fog, values), applied = exactPixel(found, p);
        light.put(frame.name, frame.seed, p, applied.light(valuesOf(found, p, "G"), kForever, true),
                  lightOf(exact, values, kForever, true), magnitude(values));
        alpha.put(frame.name, frame.seed, p, applied.alphaOfAll(), exact.alphaOfAll());
      }
    }
  });
}

}  // namespace
}  // namespace fathom::stress
