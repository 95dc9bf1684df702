#include "tests/bench/pareto_methods.h"

#include <fmt/format.h>

#include "cli/denoise_budget.h"
#include "cli/denoise_job.h"
#include "deep/flatten.h"
#include "deep/one_bin.h"
#include "flat/oidn.h"
#include "nn/module.h"

namespace fathom::bench {

using deep::Quality;

namespace {

void addNeural(std::vector<Method>& methods) {
  if (!cli::hasModel({})) return;
  for (const Quality quality : {Quality::Balanced, Quality::Fast})
    for (const int components : {1, 2, 4, 0})
      if (quality == Quality::Balanced || nn::machineHasBfloat16())
        methods.push_back({fmt::format("neural {}{}", quality == Quality::Fast ? "bfloat16 " : "",
                                       components ? fmt::format("K = {}", components) : "K by tile"),
                           {quality, false, "neural", components}});
}

}  // namespace

std::vector<Method> paretoMethods() {
  const bool network = cli::findOidn({}) != nullptr;
  std::vector<Method> methods;
  const std::vector<std::pair<std::string, Quality>> qualities = {
      {"fast", Quality::Fast}, {"balanced", Quality::Balanced}, {"best", Quality::Best}};
  for (const char* guide : {"none", "nlm", "neural", "oidn"})
    for (const auto& [name, quality] : qualities)
      if (guide == std::string("oidn") ? network : guide != std::string("neural") || cli::hasModel({}))
        methods.push_back(
            {name + (guide == std::string("none") ? "" : std::string(" + ") + guide), {quality, true, guide}});
  for (const auto& [name, quality] : qualities) methods.push_back({"nlm " + name, {quality, false, "nlm"}});
  addNeural(methods);
  if (!network) return methods;
  methods.push_back({"oidn fast", {Quality::Fast, false, "oidn"}});
  methods.push_back({"oidn plain", {Quality::Balanced, false, "oidn"}, true});
  methods.push_back({"oidn prefiltered", {Quality::Balanced, false, "oidn"}});
  return methods;
}

Prepared prepare(const Method& method, const std::string& path, const std::string& scratch) {
  cli::DenoiseRequest request;
  request.input = path;
  request.output = scratch + "/none.exr";
  request.guide = "none";
  request = cli::withSetting(std::move(request), method.setting);
  cli::DenoiseJob job = cli::makeDenoiseJob(request, cli::findSequence(path), false);
  Prepared result{job.frames.front().inputs, std::move(job.plan), {}};
  if (method.plainGuides) result.plan.base->denoise = flat::oidn(flat::loadOidn(), {.prefilterGuides = false});
  std::set<std::string> notes;
  result.image = cli::openFrame(result.inputs, job.source, result.plan).read(notes);
  result.plan.firstImage.reset();
  return result;
}

deep::DeepImage denoised(const Prepared& prepared, deep::DeepImage image) {
  return cli::denoiseAsPlanned(std::move(image), prepared.inputs, prepared.plan, nullptr, {});
}

flat::Image flattened(const Prepared& prepared, const deep::DeepImage& image) {
  if (prepared.plan.deep) return deep::flatten(image);
  deep::DeepImage pixels = image.copy();
  deep::unmakeOneBin(pixels);
  return deep::toFlat(pixels);
}

}  // namespace fathom::bench
