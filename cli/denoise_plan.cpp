#include "cli/denoise_plan.h"

#include <fmt/format.h>

#include <exception>

#include "deep/channels.h"
#include "flat/error.h"

namespace fathom::cli {

namespace {

SequencePlan planFrom(const FrameInputs& inputs, const SourceOptions& options, const deep::DenoiseParams& params) {
  SequencePlan plan;
  plan.denoise.params = params;
  FrameSource source(inputs, options);
  plan.deep = source.deep();
  const Box window = source.part().dataWindow;
  const deep::DeepImage row = source.read(window.y0, std::min(window.y0 + 1, window.y1), plan.notes);
  std::vector<std::string> names;
  for (const deep::Channel& channel : row.channels) names.push_back(channel.name);
  plan.denoise.inputs = deep::findDenoiseInputs(names, row.attributes);
  for (const std::string& line : deep::describeMissing(plan.denoise.inputs))
    plan.notes.insert(fmt::format("{}: {}", inputs.main, line));
  source.want([](const std::string& name) {
    return name == "R" || name == "G" || name == "B" || name == "A" || name == "Z" || name == "ZBack";
  });
  std::set<std::string> repeated;
  plan.denoise.level = deep::meanLevel(source.read(repeated));
  return plan;
}

}  // namespace

bool isWanted(const deep::DenoisePlan& plan, const std::string& channel) {
  const bool statistic = deep::describesSamples(deep::roleOf(channel, deep::PixelType::Float));
  return !statistic || plan.params.keepStatistics || deep::denoiseReads(plan.inputs, channel);
}

SequencePlan planSequence(const std::vector<FrameInputs>& candidates, const SourceOptions& options,
                          const deep::DenoiseParams& params) {
  std::exception_ptr first;
  for (const FrameInputs& inputs : candidates) {
    try {
      return planFrom(inputs, options, params);
    } catch (const Error&) {
      if (!first) first = std::current_exception();
    }
  }
  if (first) std::rethrow_exception(first);
  fail("expected a frame to plan from, found none");
}

std::string describePlan(const deep::DenoisePlan& plan) {
  const deep::DenoiseInputs& in = plan.inputs;
  std::string text = fmt::format("quality {} gate {} keep {} level {:a} spp {} inputs", int(plan.params.quality),
                                 plan.params.gate, plan.params.keepStatistics, plan.level, in.spp);
  for (const bool flag : {in.components, in.halves, in.albedoHalves, in.variance, in.counts, in.albedo,
                          in.albedoVariance, in.normal, in.normalVariance, in.depthVariance, in.volumes})
    text += flag ? " 1" : " 0";
  return text;
}

}  // namespace fathom::cli
