#include "cli/denoise_job.h"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <numeric>

#include "base/error.h"
#include "cli/calibration.h"
#include "cli/denoise_budget.h"
#include "cli/memory_limit.h"
#include "cli/method_choice.h"
#include "cli/model_files.h"
#include "deep/flat_nl_means.h"
#include "deep/one_bin.h"
#include "flat/noise.h"

namespace fathom::cli {

namespace {

[[noreturn]] void usage(const std::string& option, const std::string& text) {
  throw CLI::ValidationError(option, text);
}

// A pattern for one of the files of a request; it has a place for the number where the input has one.
FilePattern outputPattern(const std::string& option, const std::string& path, const FilePattern& input) {
  FilePattern pattern = parsePattern(path);
  if (!path.ends_with(".exr")) usage(option, fmt::format("expected a name that ends in .exr, found {}", path));
  if (pattern.numbered() != input.numbered())
    usage(option,
          fmt::format("expected a {} name like the input's, found {}", input.numbered() ? "numbered" : "plain", path));
  return pattern;
}

// "a.####.exr" becomes "a.diffuse.####.exr", "a.exr" becomes "a.diffuse.exr".
FilePattern beside(const FilePattern& output, const std::string& component) {
  FilePattern result = output;
  if (!output.numbered())
    result.before = output.before.substr(0, output.before.size() - 4) + "." + component + ".exr";
  else if (output.before.ends_with('_'))
    result.before += component + "_";
  else
    result.before += (output.before.ends_with('.') ? "" : ".") + component + ".";
  return result;
}

FrameInputs inputsAt(const DenoiseRequest& request, const FilePattern& input, int frame) {
  const auto at = [&](const std::string& path) { return path.empty() ? path : parsePattern(path).at(frame); };
  FrameInputs inputs{input.at(frame), at(request.features), {}, at(request.alpha), {}};
  for (size_t i = 0; i < request.halves.size(); ++i) inputs.halves[i] = at(request.halves[i]);
  if (isGuideFile(request.guide)) inputs.guide = at(request.guide);
  return inputs;
}

std::vector<DenoiseFrame> framesOf(const DenoiseRequest& request, const Sequence& sequence) {
  const FilePattern output = outputPattern("-o", request.output, sequence.pattern);
  std::vector<DenoiseFrame> frames;
  for (const int number : sequence.frames) {
    DenoiseFrame frame{number, inputsAt(request, sequence.pattern, number), {}};
    frame.outputs.image = output.at(number);
    if (!request.flattened.empty())
      frame.outputs.flattened = outputPattern("--flat", request.flattened, sequence.pattern).at(number);
    if (request.split)
      for (const char* component : {"diffuse", "specular"})
        frame.outputs.components[component] = beside(output, component).at(number);
    frames.push_back(std::move(frame));
  }
  return frames;
}

bool sameFile(const std::string& a, const std::string& b) {
  std::error_code none;
  return a == b || std::filesystem::equivalent(a, b, none);
}

// Before hours of work: that no input is overwritten, and that there is a place for the outputs.
void checkOutputs(const DenoiseFrame& frame) {
  const std::vector<std::string> outputs = frame.outputs.files();
  for (size_t i = 0; i < outputs.size(); ++i) {
    for (const std::string& input : frame.inputs.files())
      if (sameFile(input, outputs[i])) usage("-o", fmt::format("expected another file than the input {}", input));
    for (size_t k = 0; k < i; ++k)
      if (sameFile(outputs[k], outputs[i]))
        usage("-o", fmt::format("expected different files, found {} twice", outputs[i]));
    const std::string folder = std::filesystem::path(outputs[i]).parent_path().string();
    if (access(folder.empty() ? "." : folder.c_str(), W_OK) != 0)
      fail("{}: cannot write there: {}", outputs[i], std::strerror(errno));
  }
}

// All that decides what comes out, beside the plan and the contents of the inputs.
std::string describeSettings(const DenoiseRequest& request, const SourceOptions& source) {
  std::string text = fmt::format("part {} features {} halves {} alpha {}", request.part, !request.features.empty(),
                                 request.halves.size(), !request.alpha.empty());
  if (source.map)
    for (const ChannelMap::Line& line : source.map->lines) {
      text += fmt::format("\n{} ={}", line.ours, line.unpremultiplied ? " unpremultiplied" : "");
      for (const ChannelMap::Term& term : line.terms) text += fmt::format(" {} {}", term.sign, term.theirs);
    }
  return text;
}

SourceOptions sourceOptions(const DenoiseRequest& request) {
  SourceOptions source;
  source.part = request.part;
  if (!request.map.empty()) source.map = readChannelMap(request.map);
  source.memory = request.memory;
  return source;
}

// The main file of the first frame if it is not there yet: the plan may read it for the denoiser, too.
std::string firstToDo(const DenoiseJob& job) {
  const DenoiseFrame& frame = job.frames.front();
  return std::filesystem::exists(frame.outputs.image) ? "" : frame.inputs.main;
}

// The job without its plan.
DenoiseJob jobWithoutPlan(const DenoiseRequest& request, const Sequence& sequence, bool overlap) {
  if (sequence.frames.empty()) fail("{}: expected at least one frame, found none", request.input);
  DenoiseJob job;
  job.frames = framesOf(request, sequence);
  for (const DenoiseFrame& frame : job.frames) checkOutputs(frame);
  job.source = sourceOptions(request);
  job.memory = request.memory;
  job.overlap = overlap;
  job.claims = sequence.pattern.numbered();
  job.overwrite = request.overwrite;
  job.settings = describeSettings(request, job.source);
  return job;
}

// A flat frame as it would be written.
flat::Image toFlatFrame(deep::DeepImage image, std::map<std::string, std::string> attributes) {
  deep::unmakeOneBin(image);
  flat::Image flat = deep::toFlat(image);
  flat.attributes = std::move(attributes);
  return flat;
}

// What denoises flat frames in the place of our own filter.
void setBase(SequencePlan& plan, const DenoiseRequest& request) {
  const std::string& name = request.base.name;
  const bool apart = name == kNeuralBase;
  if (request.split && !apart)
    usage("--split", fmt::format("expected a --method that keeps components apart, found {}", name));
  plan.base = makeBase(request.base, plan.denoise, decodedLimit(request.memory));
  const deep::DenoiseInputs& inputs = plan.denoise.inputs;
  const auto note = [&](const std::string& line) { plan.notes.insert(fmt::format("{}: {}", plan.first, line)); };
  for (const std::string& line : deep::describeMissing(inputs))
    plan.notes.erase(fmt::format("{}: {}", plan.first, line));
  if (!apart && inputs.components)
    note(fmt::format("diffuse.* and specular.* are left out: {} denoises their sum", name));
  if (plan.base->readsStatistics) {
    plan.firstImage.reset();  // it has the statistics of our own filter
    if (plan.base->tellsErrors && !inputs.variance && !inputs.halves)
      fail("{}: expected variance.* or half0.* and half1.* for a mix, found none", plan.first);
    if (!inputs.albedo || !inputs.normal) note("no albedo.* or N.*: the network has less to go by");
    if (!inputs.variance && !inputs.halves)
      note("no variance.*, no half0.* and half1.*: the network guesses the noise");
    return;
  }
  if (!inputs.albedo) note("no albedo.*: the colours have no guides");
  if (inputs.albedo && !inputs.normal) note("no N.*: the albedo guides alone");
}

// The middle of the frame that a plan is made from, and what denoisers of that frame are bound to.
struct Sample {
  flat::Image middle;
  MethodLimits limits;
};

Sample sampleOf(const SequencePlan& plan, const DenoiseRequest& request, const SourceOptions& options,
                const std::vector<FrameInputs>& candidates) {
  const auto first =
      std::ranges::find_if(candidates, [&](const FrameInputs& inputs) { return inputs.main == plan.first; });
  FrameSource source(*first, options);
  std::set<std::string> told;
  const Box& window = source.part().dataWindow;
  const Box middle = middleOf(window);
  const flat::Image rows = toFlatFrame(source.read(middle.y0, middle.y1, told), source.flatAttributes());
  const size_t images = imagesInMemory(request.errors) * source.decodedBytes(window.y0, window.y1);
  const size_t memory = workingBytes(request.memory);
  return {flat::crop(rows, middle),
          {.scratch = decodedLimit(request.memory),
           .keepComponents = plan.denoise.inputs.components,
           .pixels = window.area(),
           .room = memory - std::min(memory, images)}};
}

// The base of flat frames, where it is to be chosen.
void chooseBase(SequencePlan& plan, DenoiseRequest& request, const Sample& sample) {
  const MethodChoice choice = chooseMethod(request.base, sample.middle, plan.denoise, sample.limits);
  request.base.name = choice.name;
  plan.notes.insert(fmt::format("{}: denoised by {}, which {}", plan.first, choice.name, choice.why));
}

// Up to so many camera samples per pixel the layered network is the better guide of ours, flattened and per bin, for no
// more time; at 16 it no longer is (docs/notes.md, Training the layered network).
constexpr double kFewSamples = 8;
constexpr int kRowsOfCounts = 64;

// What the file says, else the median of its counts in the middle; nothing where neither tells.
std::optional<double> samplesPerPixel(FrameSource& source) {
  if (const auto spp = source.part().attributes.getInt("fathom:spp"); spp && *spp > 0) return *spp;
  const Box middle = middleOf(source.part().dataWindow);
  std::set<std::string> told;
  const deep::DeepImage rows = source.read(middle.y0, std::min(middle.y0 + kRowsOfCounts, middle.y1), told);
  const deep::Channel* counts = rows.find("samples");
  std::vector<double> sums;
  for (size_t pixel = 0; counts && pixel < rows.pixels(); ++pixel) {
    const auto first = counts->values.begin() + ptrdiff_t(rows.offsets[pixel]);
    if (rows.count(pixel) > 0) sums.push_back(std::accumulate(first, first + ptrdiff_t(rows.count(pixel)), 0.0));
  }
  if (sums.empty()) return {};
  const auto middlemost = sums.begin() + ptrdiff_t(sums.size() / 2);
  std::ranges::nth_element(sums, middlemost);
  return *middlemost;
}

// Whether `auto` may be the layered network: nothing is asked for that it lacks, and Open Image Denoise is not there.
bool mayBeLayers(const SequencePlan& plan, const DenoiseRequest& request) {
  return guideChoice(request) == "auto" && request.base.model.empty() && !request.timeBudget && !request.errors &&
         plan.denoise.params.filter == deep::FilterKind::Own && plan.denoise.params.quality != deep::Quality::Fast &&
         canBeGuided(plan.denoise.inputs) && !findOidn(request.base.oidnLibrary) && hasLayersModel();
}

// What guides the bins of deep frames.
void setGuide(SequencePlan& plan, const DenoiseRequest& request, const SourceOptions& options,
              const std::vector<FrameInputs>& candidates) {
  const auto first =
      std::ranges::find_if(candidates, [&](const FrameInputs& inputs) { return inputs.main == plan.first; });
  FrameSource source = openFrame(*first, options, plan);
  const Box& window = source.part().dataWindow;
  const bool asked = guideChoice(request) == kLayersBase;
  if (asked || (mayBeLayers(plan, request) && samplesPerPixel(source).value_or(HUGE_VAL) <= kFewSamples)) {
    const LayersPlan layers = planLayers(request.base, {request.layers.count, LayersOutput::Bins},
                                         plan.denoise.params.quality, request.memory);
    const GuidePlan guide = layersGuide(layers, options, plan.cameraSamples);
    if (asked || (layersFit(layers, window) && guideFits(guide, window.area(), request.memory))) plan.guide = guide;
    if (plan.guide && !asked)
      plan.notes.insert(fmt::format("{}: bins are guided by the layered network, as samples are few", plan.first));
  }
  if (!plan.guide)
    plan.guide = planGuide(guideChoice(request), request.base, plan.denoise, source, request.memory, plan.notes);
  plan.denoise.guided = plan.guide.has_value();
}

// A whole frame by the layered network alone.
AnyImage denoiseLayered(const SequencePlan& plan, const FrameInputs& inputs, const SourceOptions& options,
                        const Progress& progress) {
  LayersPlan layers = *plan.layers;
  layers.params.memory = 0;  // one band
  LayersFrame frame(layers, inputs, options, plan.cameraSamples);
  if (layers.output == LayersOutput::Flat) return frame.flattened(progress);
  return frame.denoise(frame.bands().front(), progress, nullptr);
}

// The files that the frames of the whole sequence come to.
std::vector<std::string> outputsOf(const DenoiseRequest& request, const Sequence& sequence) {
  const FilePattern output = outputPattern("-o", request.output, sequence.pattern);
  std::vector<std::string> files;
  for (const int frame : output.numbered() ? framesOnDisk(output) : sequence.frames) files.push_back(output.at(frame));
  return files;
}

// Decides what a time budget leaves to be decided: in the plan, and in the request for what comes after it.
void setBudget(SequencePlan& plan, DenoiseRequest& request, const Sequence& sequence,
               const std::function<Sample()>& sampled) {
  std::optional<Sample> sample;
  if (!plan.deep && request.base.name == kAutoBase) sample = sampled();
  const auto errorOf = [&](const DenoiseSetting& setting) {
    const DenoiseRequest asked = withSetting(request, setting);
    deep::DenoisePlan denoise = plan.denoise;
    denoise.params = asked.params;
    return expectedErrorOf(asked.base, sample->middle, denoise, sample->limits);
  };
  const BudgetPlan budget = planBudget(
      request, plan, outputsOf(request, sequence), [] { return calibrationSeconds() / measuredCalibration(); },
      sample && flat::tellsNoise(sample->middle) ? ErrorOf(errorOf) : ErrorOf());
  plan.record = BudgetRecord{describeBudget(*request.timeBudget), describeSetting(budget.setting)};
  plan.notes.insert(budget.note);
  request = withSetting(std::move(request), budget.setting);
  plan.denoise.params = request.params;
}

// Whether the layered network is asked for, for all of the work or as a guide; and what does not go with it.
bool wantsLayers(const DenoiseRequest& request) {
  const bool alone = request.base.name == kLayersBase && request.layers.output != LayersOutput::Bins;
  const bool guides = request.guide == kLayersBase || (request.guide == "auto" && request.base.name == kLayersBase);
  if (!alone && !guides) return false;
  if (request.timeBudget) usage("--time-budget", "expected another method than layers, whose work is not measured");
  if (request.errors) usage("--error", "expected another method than layers, whose errors nothing tells");
  if (alone && request.split) usage("--split", "expected --as bins: layers have no components");
  if (alone && request.params.keepStatistics) usage("--keep", "expected --as bins: what is left describes no bins");
  if (alone && request.guide != "auto") usage("--flat-guide", "expected --as bins: nothing else is guided");
  return true;
}

// From the first frame of the sequence on disk, whether it is among the job's or not.
SequencePlan makePlan(DenoiseRequest request, const Sequence& sequence, const SourceOptions& source,
                      const std::string& wanted) {
  std::vector<FrameInputs> candidates;
  for (const int frame : sequence.pattern.numbered() ? framesOnDisk(sequence.pattern) : sequence.frames)
    candidates.push_back(inputsAt(request, sequence.pattern, frame));
  const bool layers = wantsLayers(request);
  const auto layered = [&](LayersOutput output) {
    return planLayered(
        candidates, source,
        planLayers(request.base, {request.layers.count, output}, request.params.quality, request.memory));
  };
  if (layers && request.base.name == kLayersBase && request.layers.output != LayersOutput::Bins)
    return layered(request.layers.output);
  SequencePlan plan = planSequence(candidates, source, request.params, wanted);
  if (layers && !plan.deep) fail("{}: expected a deep file for --method layers, found a flat one", plan.first);
  if (layers && !canBeGuided(plan.denoise.inputs)) {
    SequencePlan other = layered(LayersOutput::LayerBins);
    other.notes.insert(fmt::format("{}: nothing tells its noise: bins get the colours of their layers", other.first));
    return other;
  }
  plan.errors = request.errors;
  if (!plan.deep && !request.flattened.empty())
    fail("{}: expected a deep file for --flat, found a flat one", request.input);
  if (request.split && !plan.denoise.inputs.components)
    fail("{}: expected diffuse.* and specular.* for --split, found neither", request.input);
  const auto sampled = [&] { return sampleOf(plan, request, source, candidates); };
  if (request.timeBudget) setBudget(plan, request, sequence, sampled);
  if (!plan.deep && request.base.name == kAutoBase) chooseBase(plan, request, sampled());
  if (plan.deep)
    setGuide(plan, request, source, candidates);
  else if (request.base.name != kOwnBase)
    setBase(plan, request);
  return plan;
}

}  // namespace

bool isGuideFile(const std::string& guide) {
  for (const char* word : {"auto", kOwnBase, kNeuralBase, kOidnBase, kLayersBase, "none"})
    if (guide == word) return false;
  return true;
}

std::string guideChoice(const DenoiseRequest& request) {
  if (request.guide == "auto" && baseNames(request.base.name).size() > 1)
    usage("--method", fmt::format("expected one denoiser for deep frames, whose flattened ones it guides, found {}",
                                  request.base.name));
  const bool named = request.base.name != kOwnBase && request.base.name != kAutoBase;
  return request.guide == "auto" && named ? request.base.name : request.guide;
}

DenoiseJob makeDenoiseJob(const DenoiseRequest& request, const Sequence& sequence, bool overlap) {
  DenoiseJob job = jobWithoutPlan(request, sequence, overlap);
  job.plan = makePlan(request, sequence, job.source, firstToDo(job));
  return job;
}

AnyImage denoiseFrame(const DenoiseRequest& request, const Sequence& sequence, int frame, const Progress& progress) {
  const SourceOptions options = sourceOptions(request);
  const FrameInputs inputs = inputsAt(request, sequence.pattern, frame);
  SequencePlan plan = makePlan(request, sequence, options, inputs.main);
  progress.at(0);
  if (plan.layers) return denoiseLayered(plan, inputs, options, progress);
  FrameSource source = openFrame(inputs, options, plan);
  std::set<std::string> notes;
  deep::DeepImage image =
      plan.firstImage && plan.first == inputs.main ? std::move(*plan.firstImage) : source.read(notes);
  image = denoiseAsPlanned(std::move(image), inputs, plan, nullptr, progress);
  if (plan.deep) return image;
  return toFlatFrame(std::move(image), source.flatAttributes());
}

}  // namespace fathom::cli
