// `fathom denoise`: its options, and what they make of a sequence.
#include <fmt/format.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>

#include "cli/commands.h"
#include "cli/denoise_sequence.h"
#include "cli/denoise_stats.h"
#include "cli/interrupt.h"
#include "cli/sequence.h"
#include "flat/error.h"

namespace fathom::cli {

namespace {

struct DenoiseCommand {
  std::string input, output;
  std::string flattened;
  std::string features, alpha, map, part, frames, stats;
  std::vector<std::string> halves;
  std::string quality = "balanced";
  std::string missing = "fail";
  bool noGate = false;
  bool keep = false;
  bool components = false;
  bool overwrite = false;
  int threads = 0;  // 0: all
  size_t memory = size_t(8) << 30;
};

constexpr const char* kFooter = R"(
What is there is used, what is missing is estimated: half0.* and half1.* (or --half), samples, variance.*, albedo.*, N.*,
diffuse.* and specular.*; R G B A and Z are enough for an answer. `fathom info IN` says what a file offers.

OUT has the bins, alphas, depths, ids and unknown channels of IN, and the denoised R G B, diffuse.* and specular.*; half
buffers, variances and counts describe the noisy colours and stay out of it unless --keep. A flat IN gives a flat OUT.

The method, and the brightness that constants scale with, are decided from the first frame of the sequence on disk,
whatever --frames says, so that a farm may split a sequence and the parts agree. Every output is written beside its place
and renamed when complete; started again, a run does only what is missing.

Exit status: 0 all frames done, 1 some failed (one line each), 2 usage, 130 stopped.)";

[[noreturn]] void usage(const std::string& option, const std::string& text) {
  throw CLI::ValidationError(option, text);
}

// A pattern for one of the command's files; it has a place for the number where the input has one.
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

FrameInputs inputsAt(const DenoiseCommand& command, int frame) {
  const auto at = [&](const std::string& path) { return path.empty() ? path : parsePattern(path).at(frame); };
  FrameInputs inputs{at(command.input), at(command.features), {}, at(command.alpha)};
  for (size_t i = 0; i < command.halves.size(); ++i) inputs.halves[i] = at(command.halves[i]);
  return inputs;
}

std::vector<DenoiseFrame> framesOf(const DenoiseCommand& command, const Sequence& sequence) {
  const FilePattern output = outputPattern("-o", command.output, sequence.pattern);
  std::vector<DenoiseFrame> frames;
  for (const int number : sequence.frames) {
    DenoiseFrame frame{number, inputsAt(command, number), {}};
    frame.outputs.image = output.at(number);
    if (!command.flattened.empty())
      frame.outputs.flattened = outputPattern("--flat", command.flattened, sequence.pattern).at(number);
    if (command.components)
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
std::string describeSettings(const DenoiseCommand& command, const SourceOptions& source) {
  std::string text = fmt::format("part {} features {} halves {} alpha {}", command.part, !command.features.empty(),
                                 command.halves.size(), !command.alpha.empty());
  if (source.map)
    for (const ChannelMap::Line& line : source.map->lines) {
      text += fmt::format("\n{} ={}", line.ours, line.unpremultiplied ? " unpremultiplied" : "");
      for (const ChannelMap::Term& term : line.terms) text += fmt::format(" {} {}", term.sign, term.theirs);
    }
  return text;
}

deep::DenoiseParams paramsOf(const DenoiseCommand& command) {
  using deep::Quality;
  const Quality quality = command.quality == "fast"   ? Quality::Fast
                          : command.quality == "best" ? Quality::Best
                                                      : Quality::Balanced;
  return {quality, !command.noGate, command.keep};
}

// The main file of the first frame if it is not there yet: the plan may read it for the denoiser, too.
std::string firstToDo(const DenoiseJob& job) {
  const DenoiseFrame& frame = job.frames.front();
  return std::filesystem::exists(frame.outputs.image) ? "" : frame.inputs.main;
}

// Frames that ought to be there and are not; true where that is a failure.
bool reportMissing(const DenoiseCommand& command, const Sequence& sequence) {
  if (sequence.missing.empty()) return false;
  const bool failure = command.missing == "fail";
  fmt::print(stderr, "{}{}: {} missing: {}\n", failure ? "fathom: " : "", sequence.pattern.text(),
             sequence.missing.size() == 1 ? "frame" : "frames", describeFrames(sequence.missing));
  return failure;
}

// The job without its plan.
DenoiseJob makeJob(const DenoiseCommand& command, const Sequence& sequence, int threads) {
  DenoiseJob job;
  job.frames = framesOf(command, sequence);
  for (const DenoiseFrame& frame : job.frames) checkOutputs(frame);
  job.source.part = command.part;
  if (!command.map.empty()) job.source.map = readChannelMap(command.map);
  job.source.memory = job.memory = command.memory;
  job.overlap = threads > 1;
  job.overwrite = command.overwrite;
  job.settings = describeSettings(command, job.source);
  return job;
}

// From the first frame of the sequence on disk, whether it is among the job's or not.
SequencePlan makePlan(const DenoiseCommand& command, const Sequence& sequence, const DenoiseJob& job) {
  std::vector<FrameInputs> candidates;
  if (sequence.pattern.numbered())
    for (const int frame : framesOnDisk(sequence.pattern)) candidates.push_back(inputsAt(command, frame));
  else
    candidates.push_back(job.frames.front().inputs);
  SequencePlan plan = planSequence(candidates, job.source, paramsOf(command), firstToDo(job));
  if (!plan.deep && !command.flattened.empty())
    fail("{}: expected a deep file for --flat, found a flat one", command.input);
  if (command.components && !plan.denoise.inputs.components)
    fail("{}: expected diffuse.* and specular.* for --components, found neither", command.input);
  for (const std::string& note : plan.notes) fmt::print(stderr, "{}\n", note);
  return plan;
}

void runDenoise(const DenoiseCommand& command) {
  const Interrupt interrupt;
  const int threads = command.threads > 0 ? command.threads : int(std::max(1u, std::thread::hardware_concurrency()));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
  if (!command.frames.empty() && !parsePattern(command.input).numbered())
    usage("--frames", fmt::format("expected a sequence such as name.####.exr, found {}", command.input));

  const auto start = std::chrono::steady_clock::now();
  const Sequence sequence = findSequence(command.input, command.frames);
  DenoiseJob job = makeJob(command, sequence, threads);
  job.plan = makePlan(command, sequence, job);
  const double planSeconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const bool missing = reportMissing(command, sequence);
  const std::vector<DenoiseFrame> frames = job.frames;
  std::vector<FrameReport> reports;
  {
    ProgressDisplay display(frames.size());
    reports = denoiseSequence(std::move(job), display, interrupt.token());
  }
  if (!command.stats.empty()) writeStats(command.stats, frames, reports, planSeconds);
  const bool failed = std::any_of(reports.begin(), reports.end(), [](const FrameReport& report) {
    return report.status == FrameReport::Status::Failed;
  });
  if (failed || missing) throw Incomplete();
}

}  // namespace

void addDenoise(CLI::App& app) {
  auto command = std::make_shared<DenoiseCommand>();
  CLI::App* sub = app.add_subcommand("denoise", "Clean the noise from a deep or flat render, bins untouched");
  sub->footer(kFooter);
  const auto option = [&](const char* name, auto& value, const char* type, const std::string& text) {
    return sub->add_option(name, value, text)->type_name(type);
  };
  // What is not understood is a usage error.
  const auto understood = [](auto parse) {
    return CLI::Validator(
        [parse](const std::string& text) {
          try {
            parse(text);
          } catch (const Error& e) {
            return std::string(e.what());
          }
          return std::string();
        },
        "");
  };
  option("IN", command->input, "", "EXR file, or a sequence: name.####.exr, name.%04d.exr")
      ->required()
      ->check(understood(parsePattern));
  option("-o,--output", command->output, "OUT", "Where the result goes, numbered as IN is")
      ->required()
      ->check(understood(parsePattern));
  option("--flat", command->flattened, "OUT2", "Also write the flattened result");
  sub->add_flag("--components", command->components,
                "Also write diffuse and specular each to a file beside OUT (which holds both as channels)");
  option("--quality", command->quality, "fast|balanced|best",
         "fast takes three quarters of the time of balanced, best two and a half times as much")
      ->check(CLI::IsMember({"fast", "balanced", "best"}).description(""))
      ->default_str(command->quality);
  sub->add_flag("--no-gate", command->noGate, "The published filter alone, which lets some light bleed between bins");
  sub->add_flag("--keep", command->keep, "Keep half buffers, variances and counts in OUT");
  option("--frames", command->frames, "RANGE", "1-100, 1-100x2 or 1,3,5-9 (default: all that are on disk)")
      ->check(understood(parseFrames));
  option("--frames-missing", command->missing, "skip|fail", "Whether a missing frame is a failure; the others are done")
      ->check(CLI::IsMember({"skip", "fail"}).description(""))
      ->default_str(command->missing);
  option("--part", command->part, "PART", "Part of IN, by number or name (default: the first deep one)");
  option("--map", command->map, "FILE",
         fmt::format("Channel names of another renderer: lines such as albedo = diffuse_albedo, or one of: {}",
                     fmt::join(presetNames(), ", ")));
  option("--features", command->features, "FILE", "Deep or flat file with the albedo.* and N.* that IN lacks");
  option("--half", command->halves, "A B",
         "Renders from the even and from the odd camera samples, where IN has no half0.*")
      ->expected(2);
  option("--alpha", command->alpha, "FILE", "Deep render of many more camera samples, whose alphas the bins of IN get");
  option("--threads", command->threads, "N", "How many threads (default: all)")
      ->check(CLI::Range(1, 1024).description(""));
  option("--memory", command->memory, "SIZE", "How much memory; larger frames go through in bands of rows")
      ->transform(CLI::AsSizeValue(false).description(""))
      ->default_str("8G");
  option("--stats", command->stats, "FILE", "Write times, counts and memory as JSON");
  sub->add_flag("--overwrite", command->overwrite, "Replace outputs that other settings or another input made");
  sub->callback([command] { runDenoise(*command); });
}

}  // namespace fathom::cli
