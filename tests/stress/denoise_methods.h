// All ways to denoise bins, for their laws.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "deep/base_guide.h"
#include "deep/denoise.h"
#include "deep/flat_nl_means.h"
#include "tests/reference/noisy_flat.h"
#include "tests/stress/extreme_noisy.h"

namespace fathom::stress {

// A way to denoise bins.
struct Method {
  const char* name;
  deep::DenoiseParams params;
  bool guided = false;
};

inline const std::vector<Method> kMethods{{"own", {}},
                                          {"own, fast, no gate", {.quality = deep::Quality::Fast, .gate = false}},
                                          {"own, best", {.quality = deep::Quality::Best}},
                                          {"own, guided", {}, true},
                                          {"paper", {.filter = deep::FilterKind::Paper}},
                                          {"rdfc", {.filter = deep::FilterKind::Rdfc}}};

inline deep::DenoisePlan planOf(const deep::DeepImage& image, const Method& method) {
  deep::DenoisePlan plan = planFor(image, method.params);
  plan.guided = method.guided;
  return plan;
}

// With the plan of another frame, so that what is absolute stays.
inline deep::DeepImage run(const deep::DeepImage& image, const deep::DenoisePlan& plan) {
  if (!plan.guided) return deep::denoise(image.copy(), plan);
  const deep::GuideDenoisers denoisers{deep::flatNlMeans(deep::planFlattened(plan)), reference::boxDenoiser(),
                                       deep::kOwnGuide};
  const deep::BaseGuide guide = deep::makeGuide(deep::guideInput(image, plan, true), denoisers, plan);
  return deep::denoise(image.copy(), plan, {}, nullptr, &guide);
}

inline deep::DeepImage run(const deep::DeepImage& image, const Method& method) {
  return run(image, planOf(image, method));
}

inline bool isLight(const std::string& name) {
  return factorOf(name, 2) == 2 && !name.starts_with("half");
}

inline void expectFinite(const deep::DeepImage& image) {
  for (const deep::Channel& channel : image.channels) {
    if (!isLight(channel.name)) continue;
    for (const float v : channel.values) ASSERT_TRUE(std::isfinite(v)) << channel.name << " " << v;
  }
}

// The largest difference of light (not premultiplied, of bins that are seen) relative to its value, or to a hundredth of the
// frame's level where that is more.
inline double farthest(const deep::DeepImage& a, const deep::DeepImage& b, float level, double scale = 1) {
  double worst = 0;
  const auto alpha = a.get("A");
  for (const deep::Channel& channel : a.channels) {
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

}  // namespace fathom::stress
