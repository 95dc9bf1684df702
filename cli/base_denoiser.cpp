#include "cli/base_denoiser.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <utility>

#include "base/error.h"
#include "cli/memory_limit.h"
#include "cli/model_files.h"
#include "deep/flat_nl_means.h"
#include "deep/noise_response.h"
#include "flat/gate.h"
#include "flat/neural.h"
#include "flat/oidn.h"
#include "flat/progressive.h"

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
                sums["network pixels in 2 components"] += counts->inTwo.exchange(0);
                sums["network pixels in 4 components"] += counts->inFour.exchange(0);
                sums["network pixels skipped"] += counts->skipped.exchange(0);
              }};
}

// Our own filter tells its errors where it can; others are run again for that.
flat::Estimator estimatorOf(const BaseDenoiser& base, bool own, const deep::DenoisePlan& plan) {
  if (!own || !deep::tellsResponse(plan)) return flat::byProbes(base.denoise);
  return deep::nlMeansEstimator(plan);
}

BaseDenoiser mixedBase(const BaseOptions& options, deep::DenoisePlan plan, size_t scratch) {
  plan.params.gate = false;  // the mix has one of its own
  const MixChoice mix = mixOf(options);
  BaseDenoiser result;
  result.settings = "mix " + mix.settings;
  result.readsStatistics = result.gated = result.tellsErrors = true;
  std::vector<BaseDenoiser> bases;
  std::vector<flat::Estimator> estimators;
  for (const std::string& name : baseNames(options.name)) {
    BaseOptions one = options;
    one.name = name;
    bases.push_back(makeBase(one, plan, scratch));
    estimators.push_back(estimatorOf(bases.back(), name == kOwnBase, plan));
    result.settings += ", " + bases.back().settings;
  }
  flat::ProgressiveParams params;
  params.net = mix.net;
  result.denoise = [estimators, params](const flat::Image& noisy, const Progress& progress) {
    return flat::denoiseProgressively(noisy, estimators, params, progress);
  };
  result.bytes = [bases, net = mix.net](size_t pixels, size_t room) {
    size_t most = 0;  // one after the other
    for (const BaseDenoiser& base : bases)
      if (base.bytes) most = std::max(most, base.bytes(pixels, room));
    const size_t threads = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
    return most + mixBytes(pixels, bases.size()) + (net ? threads * net->bytesPerThread(int(bases.size())) : 0);
  };
  result.addCounts = [bases](std::map<std::string, uint64_t>& sums) {
    for (const BaseDenoiser& base : bases)
      if (base.addCounts) base.addCounts(sums);
  };
  return result;
}

}  // namespace

std::vector<std::string> baseNames(const std::string& text) {
  return CLI::detail::split(text, ',');
}

void addBaseOptions(CLI::App& command, BaseOptions& options) {
  const auto areNames = [](const std::string& text) {
    const std::vector<std::string> names = baseNames(text);
    for (const std::string& name : names) {
      if (name != kOwnBase && name != kNeuralBase && name != kOidnBase &&
          ((name != kAutoBase && name != kLayersBase) || names.size() > 1))
        return fmt::format("expected nlm, neural and oidn, or auto or layers alone, found {}", name);
      if (std::ranges::count(names, name) > 1) return fmt::format("expected {} once", name);
    }
    return std::string();
  };
  command
      .add_option("--method,--base", options.name,
                  "The denoiser of flat frames: Fathom's own filter, its network, or Open Image Denoise where it is "
                  "installed; several (nlm,oidn) are mixed by their estimated errors; auto takes the one that promises "
                  "the least error on the first frame; layers is the network of deep frames, which reads their samples")
      ->type_name("nlm|neural|oidn|layers|auto")
      ->check(CLI::Validator(areNames, ""))
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
      .add_option("--mix", options.mix,
                  "How several denoisers are mixed, and in `fathom progressive` with the render: by a network that "
                  "corrects a formula, or by "
                  "the formula alone; auto takes the network where it is installed")
      ->type_name("learned|formula|auto")
      ->check(CLI::IsMember({kLearnedMix, kFormulaMix, kAutoMix}).description(""))
      ->default_str(options.mix);
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

MixChoice mixOf(const BaseOptions& options) {
  if (options.mix == kFormulaMix || (options.mix == kAutoMix && !hasMix())) return {nullptr, "formula"};
  MixModel model = loadMix();
  return {model.net, model.settings};
}

BaseDenoiser makeBase(const BaseOptions& options, const deep::DenoisePlan& plan, size_t scratch) {
  if (options.name == kLayersBase) fail("--method {}: expected deep frames, found flat ones", kLayersBase);
  if (baseNames(options.name).size() > 1) return mixedBase(options, plan, scratch);
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

double networkWork(BaseOptions options, bool guide) {
  constexpr double kSmall = 72e3;  // per pixel, K = 1, width 16
  if (guide && options.model.empty()) options.model = defaultModel(true);
  return modelOf(options, deep::Quality::Balanced).net->flopPerPixel(1) / kSmall;
}

bool hasModel(const BaseOptions& options) {
  return !options.model.empty() || !defaultModel(false).empty();
}

}  // namespace fathom::cli
