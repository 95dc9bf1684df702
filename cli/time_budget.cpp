#include "cli/time_budget.h"

#include <algorithm>
#include <tuple>

namespace fathom::cli {

namespace {

using deep::Quality;

// The share of the time of our own filters that is left where the colour is one component (staircase2 at 8 samples).
constexpr double kOneComponent = 0.75;

// What `bench_pareto` prints as "For cli/time_budget.cpp", over the eight shared renders.
const std::vector<SettingCost>& table() {
  static const std::vector<SettingCost> costs = {
      {{Quality::Fast, true, "none"}, 0, 4.17, 0, 0.122},
      {{Quality::Balanced, true, "none"}, 0, 7.44, 0, 0.112},
      {{Quality::Best, true, "none"}, 0, 13.4, 0, 0.107},
      {{Quality::Fast, true, "nlm"}, 5.39, 4.17, 0, 0.121},
      {{Quality::Balanced, true, "nlm"}, 4.22, 7.44, 0, 0.111},
      {{Quality::Best, true, "nlm"}, 10.6, 13.4, 0, 0.106},
      {{Quality::Fast, true, "oidn"}, 0, 4.17, 69.2, 0.0829},
      {{Quality::Balanced, true, "oidn"}, 0, 7.44, 52.1, 0.082},
      {{Quality::Best, true, "oidn"}, 0, 13.4, 44.6, 0.0817},
      {{Quality::Fast, false, "nlm"}, 3.28, 0, 0, 0.116},
      {{Quality::Balanced, false, "nlm"}, 4.57, 0, 0, 0.104},
      {{Quality::Best, false, "nlm"}, 10.5, 0, 0, 0.0968},
      {{Quality::Fast, false, "oidn"}, 0, 0, 2.91, 0.0805},
      {{Quality::Balanced, false, "oidn"}, 0, 0, 34.6, 0.0588},
  };
  return costs;
}

constexpr double kCalibration = 0.303;

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

double expectedSeconds(const SettingCost& cost, const Workload& workload, double slowness) {
  const double filters = cost.perMegapixel + cost.perMillionBins * workload.binsPerPixel;
  const double perMegapixel = cost.network + filters * (workload.components ? 1 : kOneComponent);
  return slowness * workload.megapixels * perMegapixel;
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
