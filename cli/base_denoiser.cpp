#include "cli/base_denoiser.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "deep/flat_nl_means.h"
#include "flat/error.h"
#include "flat/oidn.h"

namespace fathom::cli {

void addBaseOptions(CLI::App& command, BaseOptions& options) {
  command
      .add_option("--base", options.name,
                  "The denoiser of flat frames: Fathom's own, or Open Image Denoise where it is installed")
      ->type_name("nlm|oidn")
      ->check(CLI::IsMember({kOwnBase, "oidn"}).description(""))
      ->default_str(options.name);
  command
      .add_option("--oidn-library", options.oidnLibrary,
                  "Open Image Denoise's library, or the folder it is in (default: FATHOM_OIDN_LIBRARY, else where the "
                  "system finds it)")
      ->type_name("PATH");
}

std::string describeFilter(const deep::DenoisePlan& plan) {
  const deep::DenoiseInputs& in = plan.inputs;
  std::string text =
      fmt::format("filter {} quality {} gate {} keep {} level {:a} spp {} inputs", int(plan.params.filter),
                  int(plan.params.quality), plan.params.gate, plan.params.keepStatistics, plan.level, in.spp);
  for (const bool flag : {in.components, in.halves, in.halfCounts, in.albedoHalves, in.variance, in.counts, in.albedo,
                          in.albedoVariance, in.normal, in.normalVariance, in.depthVariance, in.volumes})
    text += flag ? " 1" : " 0";
  return text;
}

std::shared_ptr<const flat::OidnLibrary> findOidn(const std::string& path) {
  try {
    return flat::loadOidn(path);
  } catch (const Error&) {
    return nullptr;
  }
}

BaseDenoiser makeBase(const BaseOptions& options, const deep::DenoisePlan& plan, size_t scratch) {
  if (options.name == kOwnBase) return {deep::flatNlMeans(plan), describeFilter(plan)};
  flat::OidnParams params;
  if (plan.params.quality == deep::Quality::Fast) {
    params.quality = flat::OidnParams::Quality::Fast;
    params.prefilterGuides = false;
  }
  params.scratchMegabytes = int(std::clamp<size_t>(scratch / 1'000'000, 1, 1'000'000));
  const auto library = flat::loadOidn(options.oidnLibrary);
  return {flat::oidn(library, params), flat::describeOidn(*library, params)};
}

}  // namespace fathom::cli
