#include "cli/denoise_budget.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>

#include "base/error.h"
#include "cli/memory_limit.h"
#include "flat/sure.h"
#include "nn/module.h"

namespace fathom::cli {

namespace {

// Bins per pixel where camera samples are clustered first: more than they come to on renders.
constexpr double kMostClustered = 3;

// The guides or bases that a setting may have.
std::vector<std::string> openWays(const DenoiseRequest& request, const SequencePlan& plan) {
  if (!plan.deep) {
    if (!request.anyBase) return {request.base.name};
    std::vector<std::string> ways = {kOwnBase};
    if (hasModel(request.base)) ways.emplace_back(kNeuralBase);
    if (!plan.denoise.inputs.components && !request.split && findOidn(request.base.oidnLibrary))
      ways.emplace_back(kOidnBase);
    return ways;
  }
  const std::string choice = guideChoice(request);
  if (isGuideFile(choice)) return {kGuideFile};
  if (choice != "auto") return {choice};
  if (!canBeGuided(plan.denoise.inputs)) return {"none"};
  std::vector<std::string> ways = {"none", kOwnBase};
  if (hasModel(request.base)) ways.emplace_back(kNeuralBase);
  if (findOidn(request.base.oidnLibrary)) ways.emplace_back(kOidnBase);
  return ways;
}

// Whether a request lets a setting be; the library is not looked for, so that its absence is an error of its own.
bool allows(const DenoiseRequest& request, const SequencePlan& plan, const DenoiseSetting& setting) {
  if (setting.deep != plan.deep) return false;
  if (setting.with == kNeuralBase && setting.components && request.base.components &&
      request.base.components != setting.components)
    return false;
  if (!plan.deep) return request.anyBase || setting.with == request.base.name;
  const std::string choice = guideChoice(request);
  if (choice == "auto") return setting.with != kGuideFile;
  return setting.with == (isGuideFile(choice) ? kGuideFile : choice);
}

Workload workloadOf(const SequencePlan& plan) {
  const auto pixels = double(std::max<size_t>(plan.pixels, 1));
  const double perPixel = double(plan.samples) / pixels;
  return {pixels * 1e-6, plan.cameraSamples ? std::min(perPixel, kMostClustered) : perPixel,
          plan.denoise.inputs.components, plan.errors ? 1 + flat::SureParams().probes : 1, runsOf(plan)};
}

// Whether whole frames leave a way its memory; our own filter takes bands.
bool fits(const std::string& way, const DenoiseRequest& request, const SequencePlan& plan) {
  if (plan.deep) return guideFits(way, request.base, plan.denoise, plan.pixels, request.memory);
  if (way != kNeuralBase) return true;
  BaseOptions named = request.base;
  named.name = kNeuralBase;
  const size_t scratch = decodedLimit(request.memory);
  return makeBase(named, plan.denoise, scratch).bytes(plan.pixels, scratch) <= workingBytes(request.memory) / 2;
}

// What a budget may choose from: where that is more than one way, without those that cannot be had or need too much memory.
std::vector<SettingCost> openCosts(const DenoiseRequest& request, const SequencePlan& plan, Workload& workload) {
  std::vector<std::string> ways = openWays(request, plan);
  if (ways.size() > 1)
    std::erase_if(ways, [&](const std::string& way) {
      try {
        return !fits(way, request, plan);
      } catch (const Error&) {
        return true;
      }
    });
  if (std::ranges::find(ways, kNeuralBase) != ways.end()) {
    workload.bfloat16 = nn::machineHasBfloat16();
    workload.networkWork = networkWork(request.base, plan.deep);
  }
  std::vector<SettingCost> costs = costsOf(plan.deep, ways);
  std::erase_if(costs, [&](const SettingCost& cost) { return !allows(request, plan, cost.setting); });
  return costs;
}

// Of each way the setting with the least error of those that fit; nothing where none fits.
std::vector<SettingCost> bestOfWays(const std::vector<SettingCost>& costs, const Workload& workload, double budget,
                                    double slowness) {
  std::map<std::string, std::vector<SettingCost>> byWay;
  for (const SettingCost& cost : costs) byWay[cost.setting.with].push_back(cost);
  std::vector<SettingCost> result;
  for (const auto& [way, its] : byWay)
    if (const BudgetChoice choice = chooseSetting(its, workload, budget, slowness); choice.fits)
      result.push_back(*std::ranges::find(its, choice.setting, &SettingCost::setting));
  return result;
}

// What the outputs say, and the file that says it.
struct Found {
  std::string path;
  BudgetRecord record;
};
std::optional<Found> findRecord(const std::vector<std::string>& outputs, const std::string* budget) {
  for (const std::string& path : outputs)
    if (const auto record = readRecord(path); record && (!budget || record->budget == *budget))
      return Found{path, *record};
  return {};
}

}  // namespace

std::string describeBudget(double seconds) {
  return fmt::format("{} s", seconds);
}

BudgetPlan planBudget(const DenoiseRequest& request, const SequencePlan& plan, const std::vector<std::string>& outputs,
                      const std::function<double()>& slowness, const ErrorOf& errorOf) {
  const std::string budget = describeBudget(*request.timeBudget);
  if (const auto found = findRecord(outputs, request.overwrite ? &budget : nullptr)) {
    const auto setting = parseSetting(found->record.setting);
    if (setting && allows(request, plan, *setting))
      return {*setting, fmt::format("{}: made with {} for {} a frame, which the sequence keeps", found->path,
                                    found->record.setting, found->record.budget)};
    if (!request.overwrite)
      fail(
          "{}: expected a setting that these options allow, as its sequence keeps to one; found {} (--overwrite "
          "chooses anew)",
          found->path, found->record.setting);
  }
  Workload workload = workloadOf(plan);
  std::vector<SettingCost> costs = openCosts(request, plan, workload);
  if (costs.empty())
    throw CLI::ValidationError("--time-budget", fmt::format("expected a method or guide whose cost is known, found {}",
                                                            openWays(request, plan).front()));
  const double slow = slowness();
  if (errorOf) {
    if (auto fitting = bestOfWays(costs, workload, *request.timeBudget, slow); fitting.size() > 1) {
      for (SettingCost& cost : fitting) cost.error = errorOf(cost.setting);
      costs = std::move(fitting);
    }
  }
  const BudgetChoice choice = chooseSetting(costs, workload, *request.timeBudget, slow);
  const std::string setting = describeSetting(choice.setting);
  if (!choice.fits)
    return {choice.setting, fmt::format("{}: {} a frame are too few; the quickest setting, {}, takes about {:.2g} s",
                                        plan.first, budget, setting, choice.seconds)};
  return {choice.setting,
          fmt::format("{}: {} a frame allow {}, about {:.2g} s", plan.first, budget, setting, choice.seconds)};
}

DenoiseRequest withSetting(DenoiseRequest request, const DenoiseSetting& setting) {
  request.params.quality = setting.quality;
  if (setting.components) request.base.components = setting.components;
  if (!setting.deep)
    request.base.name = setting.with;
  else if (setting.with != kGuideFile)
    request.guide = setting.with;
  return request;
}

}  // namespace fathom::cli
