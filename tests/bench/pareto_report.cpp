#include "tests/bench/pareto_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cli/base_denoiser.h"

namespace fathom::bench {
namespace {

using deep::Quality;

constexpr const char* kRendered = "as rendered";

std::optional<double> meanOf(const std::vector<double>& values) {
  return values.empty() ? std::nullopt : std::optional(geometricMean(values));
}

Cell cellOf(const std::optional<double>& value) {
  return value ? Cell(*value) : Cell("");
}

const MethodResult* find(const ParetoResult& result, const cli::DenoiseSetting& setting) {
  const auto found = std::ranges::find_if(
      result.methods, [&](const MethodResult& of) { return of.method.setting == setting && !of.method.plainGuides; });
  return found == result.methods.end() ? nullptr : &*found;
}

double secondsOf(const ParetoResult& result, const cli::DenoiseSetting& setting) {
  const MethodResult* found = find(result, setting);
  return found ? found->secondsPerMegapixel : 0;
}

// What a network adds to a deep frame, whatever the quality: the mean over the qualities.
double networkOfDeep(const ParetoResult& result, const std::string& network) {
  double sum = 0, count = 0;
  for (const Quality quality : {Quality::Fast, Quality::Balanced, Quality::Best})
    if (const double guided = secondsOf(result, {quality, true, network}); guided > 0) {
      sum += guided - secondsOf(result, {quality, true, "none"});
      ++count;
    }
  return count > 0 ? std::max(0.0, sum / count) : 0;
}

struct Costs {
  double perMegapixel = 0, perMillionBins = 0, network = 0;
};

Costs costsOf(const ParetoResult& result, const MethodResult& of) {
  const auto& [quality, isDeep, with, components] = of.method.setting;
  const double seconds = of.secondsPerMegapixel;
  if (!isDeep && with == "neural") return {0, 0, seconds / result.lights};
  if (!isDeep) return with == "oidn" ? Costs{0, 0, seconds} : Costs{seconds, 0, 0};
  const double alone = secondsOf(result, {quality, true, "none"}), flat = secondsOf(result, {quality, false, "nlm"});
  const double more = std::max(0.01, result.binsPerPixel - 1);
  // Neither a pixel nor a bin costs less than nothing.
  const double perBin = std::clamp((alone - flat) / more, 0.0, alone / result.binsPerPixel);
  const bool network = with == "oidn" || with == "neural";
  const double ours = (network ? alone : seconds) - perBin * result.binsPerPixel;
  const double work = with == "neural" ? cli::networkWork({}, true) : 1;
  return {ours > 1e-6 ? ours : 0, perBin, network ? networkOfDeep(result, with) / work : 0};
}

const char* nameOf(Quality quality) {
  if (quality == Quality::Fast) return "Fast";
  return quality == Quality::Best ? "Best" : "Balanced";
}

}  // namespace

MeanErrors meansOf(const MethodResult& result, const std::string& set) {
  std::vector<double> flattened, bins, flattenedShare, binsShare;
  for (const FrameErrors& errors : result.errors) {
    if (errors.set != set) continue;
    flattened.push_back(errors.denoised);
    flattenedShare.push_back(errors.denoised / errors.noisy);
    if (!errors.denoisedBins || !errors.noisyBins) continue;
    bins.push_back(*errors.denoisedBins);
    binsShare.push_back(*errors.denoisedBins / *errors.noisyBins);
  }
  return {meanOf(flattened), meanOf(bins), meanOf(flattenedShare), meanOf(binsShare)};
}

Table setTable(const ParetoResult& result, const std::string& set) {
  Table table(fmt::format("Error against time, {}: geometric means of relMSE", set),
              {"frames", "method", "s/MP", "flattened", "of noisy", "per bin", "of noisy bins"});
  for (const MethodResult& of : result.methods) {
    const MeanErrors means = meansOf(of, set);
    if (!means.flattened) continue;
    table.add({of.method.setting.deep ? "deep" : "flat", of.method.name, of.secondsPerMegapixel,
               cellOf(means.flattened), cellOf(means.flattenedShare), cellOf(means.bins), cellOf(means.binsShare)});
  }
  return table;
}

Table frameTable(const ParetoResult& result) {
  Table table("", {"set", "frame", "kind", "method", "s/MP", "relMSE noisy", "relMSE", "relMSE per bin noisy",
                   "relMSE per bin"});
  for (const MethodResult& of : result.methods)
    for (const FrameErrors& errors : of.errors)
      table.add({errors.set, errors.frame, of.method.setting.deep ? "deep" : "flat", of.method.name,
                 of.secondsPerMegapixel, errors.noisy, errors.denoised, cellOf(errors.noisyBins),
                 cellOf(errors.denoisedBins)});
  return table;
}

Plot setPlot(const ParetoResult& result, const std::string& set, bool bins) {
  Plot plot{fmt::format("{}, {}", bins ? "Error per bin" : "Error of the flattened frame", set),
            "seconds per megapixel",
            bins ? "relMSE per bin" : "relMSE, flattened",
            {},
            bins ? std::vector<std::string>{"deep"} : std::vector<std::string>{"deep frames", "flat frames"}};
  for (const MethodResult& of : result.methods) {
    const MeanErrors means = meansOf(of, set);
    if (const auto error = bins ? means.bins : means.flattened)
      plot.points.push_back({of.method.name, of.secondsPerMegapixel, *error, of.method.setting.deep ? 0 : 1});
  }
  return plot;
}

std::string costRows(const ParetoResult& result) {
  std::string text;
  for (const MethodResult& of : result.methods) {
    const cli::DenoiseSetting& setting = of.method.setting;
    if (of.method.plainGuides || (setting.with == "neural" && !setting.deep && !setting.components)) continue;
    const Costs costs = costsOf(result, of);
    const MeanErrors means = meansOf(of, kRendered);
    const double share = means.flattenedShare.value_or(1);
    const double error = means.binsShare && setting.deep ? std::sqrt(share * *means.binsShare) : share;
    const std::string components = setting.components ? fmt::format(", {}", setting.components) : "";
    text += fmt::format("{{{{Quality::{}, {}, \"{}\"{}}}, {:.3g}, {:.3g}, {:.3g}, {:.3g}}},\n", nameOf(setting.quality),
                        setting.deep, setting.with, components, costs.perMegapixel, costs.perMillionBins, costs.network,
                        error);
  }
  return text + fmt::format("constexpr double kCalibration = {:.3g};\n", result.calibration);
}

}  // namespace fathom::bench
