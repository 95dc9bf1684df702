#include "cli/base_denoiser.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <utility>

#include "base/error.h"
#include "cli/memory_limit.h"
#include "cli/model_files.h"
#include "deep/flat_nl_means.h"
#include "flat/gate.h"
#include "flat/neural.h"
#include "flat/oidn.h"

namespace fathom::cli {

namespace {

BaseDenoiser oidnBase(const BaseOptions& options, deep::Quality quality, size_t scratch) {
  flat::OidnParams params;
  if (quality == deep::Quality::Fast) {
    params.quality = flat::OidnParams::Quality::Fast;
    params.prefilterGuides = false;
  }
  params.scratchMegabytes = int(std::clamp<size_t>(scratch / 1'000'000, 1, 1'000'000));
  const auto library = flat::loadOidn(options.oidnLibrary);
  return {.denoise = flat::oidn(library, params), .settings = flat::describeOidn(*library, params), .bytes = oidnBytes};
}

Model modelOf(const BaseOptions& options, deep::Quality quality) {
  const nn::Precision precision = quality == deep::Quality::Fast ? nn::Precision::automatic : nn::Precision::float32;
  if (!options.model.empty()) return loadModel(options.model, precision);
  const std::string name = defaultModel(quality == deep::Quality::Best);
  return loadModel(name.empty() ? "small" : name, precision);
}

BaseDenoiser neuralBase(const BaseOptions& options, deep::Quality quality, size_t scratch) {
  const Model model = modelOf(options, quality);
  const flat::NeuralParams params{options.components, std::max<size_t>(scratch, 1)};
  const auto counts = std::make_shared<flat::NeuralCounts>();
  return {.denoise = flat::neural(model.net, params, counts),
          .settings = fmt::format("{} components {}", model.settings, options.components),
          .bytes =
              [net = model.net, params](size_t pixels, size_t room) {
                return flat::neuralBytes(*net, {params.components, std::max<size_t>(room, 1)}, pixels);
              },
          .readsStatistics = true,
          .addCounts =
              [counts](std::map<std::string, uint64_t>& sums) {
                sums["network pixels"] += counts->denoised.exchange(0);
                sums["network pixels skipped"] += counts->skipped.exchange(0);
              }};
}

}  // namespace

void addBaseOptions(CLI::App& command, BaseOptions& options) {
  command
      .add_option("--method,--base", options.name,
                  "The denoiser of flat frames: Fathom's own filter, its network, or Open Image Denoise where it is "
                  "installed; auto takes the one that promises the least error on the first frame; layers is the "
                  "network of deep frames, which reads their samples")
      ->type_name("nlm|neural|oidn|layers|auto")
      ->check(CLI::IsMember({kOwnBase, kNeuralBase, kOidnBase, kLayersBase, kAutoBase}).description(""))
      ->default_str(options.name);
  command
      .add_option(
          "--model", options.model,
          "The network's weights, of those that `fathom models` lists or in a file (default: base for --quality "
          "best, else small; layers for --method layers)")
      ->type_name("small|base|layers|FILE");
  command
      .add_option_function<std::string>(
          "--components",
          [&options](const std::string& text) { options.components = text == "auto" ? 0 : text[0] - '0'; },
          "How many parts the network splits each light into: more take more time")
      ->type_name("1|2|4|auto")
      ->check(CLI::IsMember({"1", "2", "4", "auto"}).description(""))
      ->default_str("auto");
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
  if (options.name == kLayersBase) fail("--method {}: expected deep frames, found flat ones", kLayersBase);
  if (options.name != kOidnBase && options.name != kNeuralBase)
    return {.denoise = deep::flatNlMeans(plan), .settings = describeFilter(plan)};
  const bool oidn = options.name == kOidnBase;
  BaseDenoiser base =
      oidn ? oidnBase(options, plan.params.quality, scratch) : neuralBase(options, plan.params.quality, scratch);
  if (!plan.params.gate) return base;
  base.denoise = flat::withGate(std::move(base.denoise));
  base.settings += " gated";
  base.gated = true;
  return base;
}

bool hasModel(const BaseOptions& options) {
  return !options.model.empty() || !defaultModel(false).empty();
}

}  // namespace fathom::cli
