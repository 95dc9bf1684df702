#include "cli/time_budget.h"

#include <algorithm>
#include <tuple>

#include "cli/base_denoiser.h"

namespace fathom::cli {

namespace {

using deep::Quality;

// The share of the time of our own filters that is left where the colour is one component (staircase2 at 8 samples).
constexpr double kOneComponent = 0.75;

// How much longer our network takes in float32 than in bfloat16 (`./run bench nn`).
constexpr double kFloat32 = 2.1;

// What `./run bench pareto FOLDER 0.25 2` printed as "For cli/time_budget.cpp" for the eight renders of the README, on two
// quiet cores with AVX-512.
const std::vector<SettingCost>& table() {
  static const std::vector<SettingCost> costs = {
      {{Quality::Fast, true, "none"}, 0.202, 0.824, 0, 0.165},
      {{Quality::Balanced, true, "none"}, 0.163, 1.23, 0, 0.152},
      {{Quality::Best, true, "none"}, 0.611, 2.55, 0, 0.143},
      {{Quality::Fast, true, "nlm"}, 1.71, 0.824, 0, 0.163},
      {{Quality::Balanced, true, "nlm"}, 2.18, 1.23, 0, 0.15},
      {{Quality::Best, true, "nlm"}, 4.35, 2.55, 0, 0.142},
      // By `base`, in a later run: seconds over its arithmetic, and errors over those of the same quality without a guide.
      {{Quality::Fast, true, "neural"}, 0.202, 0.824, 1.47, 0.128},
      {{Quality::Balanced, true, "neural"}, 0.163, 1.23, 1.47, 0.128},
      {{Quality::Best, true, "neural"}, 0.611, 2.55, 1.47, 0.126},
      {{Quality::Fast, true, "oidn"}, 0.202, 0.824, 13.8, 0.107},
      {{Quality::Balanced, true, "oidn"}, 0.163, 1.23, 13.8, 0.106},
      {{Quality::Best, true, "oidn"}, 0.611, 2.55, 13.8, 0.106},
      {{Quality::Fast, false, "nlm"}, 1.03, 0, 0, 0.149},
      {{Quality::Balanced, false, "nlm"}, 1.4, 0, 0, 0.133},
      {{Quality::Best, false, "nlm"}, 3.16, 0, 0, 0.123},
      {{Quality::Fast, false, "oidn"}, 0, 0, 0.798, 0.108},
      {{Quality::Balanced, false, "oidn"}, 0, 0, 9.93, 0.0897},
      // Of one light: `./run bench nn` on the same machine. Errors: those of `nlm balanced` times what the network's are of
      // them on the three frames that `small` has not learned from (docs/notes.md).
      {{Quality::Fast, false, "neural", 1}, 0, 0, 0.3, 0.127},
      {{Quality::Fast, false, "neural", 2}, 0, 0, 0.75, 0.125},
      {{Quality::Fast, false, "neural", 4}, 0, 0, 1.55, 0.124},
      {{Quality::Balanced, false, "neural", 1}, 0, 0, 0.6, 0.127},
      {{Quality::Balanced, false, "neural", 2}, 0, 0, 1.6, 0.125},
      {{Quality::Balanced, false, "neural", 4}, 0, 0, 3.45, 0.124},
  };
  return costs;
}

constexpr double kCalibration = 0.0749;

}  // namespace

std::span<const SettingCost> measuredCosts() {
  return table();
}

double measuredCalibration() {
  return kCalibration;
}

std::vector<SettingCost> costsOf(bool deep, std::span<const std::string> with) {
  std::vector<SettingCost> result;
  for (const std::string& wanted : with)
    for (SettingCost cost : measuredCosts()) {
      if (cost.setting.deep != deep || cost.setting.with != (wanted == kGuideFile ? "none" : wanted)) continue;
      cost.setting.with = wanted;
      result.push_back(cost);
    }
  return result;
}

namespace {

// The lights of flat frames go through our network one by one; of deep ones those of the flattened frame and, where they
// were measured, the pictures of two bins.
double networkSeconds(const SettingCost& cost, const Workload& workload) {
  if (cost.setting.with != kNeuralBase) return cost.network;
  const double lights = cost.setting.deep ? (workload.components ? 1 : 0.75) : workload.components ? 2 : 1;
  const bool slower = (cost.setting.deep || cost.setting.quality == Quality::Fast) && !workload.bfloat16;
  return cost.network * workload.networkWork * lights * (slower ? kFloat32 : 1);
}

}  // namespace

double expectedSeconds(const SettingCost& cost, const Workload& workload, double slowness) {
  const double filters = cost.perMegapixel + cost.perMillionBins * workload.binsPerPixel;
  const double perMegapixel = networkSeconds(cost, workload) + filters * (workload.components ? 1 : kOneComponent);
  const bool own = !cost.setting.deep && cost.setting.with == kOwnBase;
  return slowness * (own ? workload.flatRuns : workload.runs) * workload.megapixels * perMegapixel;
}

BudgetChoice chooseSetting(std::span<const SettingCost> costs, const Workload& workload, double budget,
                           double slowness) {
  const auto seconds = [&](const SettingCost& cost) { return expectedSeconds(cost, workload, slowness); };
  const auto rank = [&](const SettingCost& cost) {
    const double time = seconds(cost);
    const bool late = !(time <= budget);
    return std::tuple(late, late ? time : cost.error, time);
  };
  const SettingCost& best =
      *std::ranges::min_element(costs, [&](const SettingCost& a, const SettingCost& b) { return rank(a) < rank(b); });
  return {best.setting, seconds(best), seconds(best) <= budget};
}

}  // namespace fathom::cli
