// `fathom denoise`: its options, and what they make of a sequence.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "base/error.h"
#include "cli/commands.h"
#include "cli/denoise_job.h"
#include "cli/denoise_stats.h"
#include "cli/interrupt.h"
#include "cli/progress_display.h"
#include "cli/sequence.h"

namespace fathom::cli {

namespace {

struct DenoiseCommand {
  DenoiseRequest request;  // but for its params
  std::string frames, stats;
  std::string quality = "balanced";
  double budget = 0;  // seconds; 0: none
  std::string filter = "own";
  std::string missing = "fail";
  bool noGate = false;
  bool keep = false;
  int threads = 0;  // 0: all
};

constexpr const char* kFooter = R"(
What is there is used, what is missing is estimated: half0.* and half1.* (or --half), samples, variance.*, albedo.*, N.*,
diffuse.* and specular.*; R G B A and Z are enough for an answer. `fathom info IN` says what a file offers.

OUT has the bins, alphas, depths, ids and unknown channels of IN, and the denoised R G B, diffuse.* and specular.*; half
buffers, variances and counts describe the noisy colours and stay out of it unless --keep. A flat IN gives a flat OUT.

The method, and the brightness that constants scale with, are decided from the first frame of the sequence on disk,
whatever --frames says, so that a farm may split a sequence and the parts agree. Every output is written beside its place
and renamed when complete; started again, a run does only what is missing.

--time-budget takes the setting that outputs of the sequence record, where there are any with one; else it times a small
frame of its own. Machines that start together on a sequence without outputs may choose differently: let one frame come
first, or give the options that the first line names to all.

Exit status: 0 all frames done, 1 some failed (one line each), 2 usage, 130 stopped.)";

[[noreturn]] void usage(const std::string& option, const std::string& text) {
  throw CLI::ValidationError(option, text);
}

deep::DenoiseParams paramsOf(const DenoiseCommand& command) {
  using deep::FilterKind, deep::Quality;
  const Quality quality = command.quality == "fast"   ? Quality::Fast
                          : command.quality == "best" ? Quality::Best
                                                      : Quality::Balanced;
  const FilterKind filter = command.filter == "paper"  ? FilterKind::Paper
                            : command.filter == "rdfc" ? FilterKind::Rdfc
                                                       : FilterKind::Own;
  return {quality, !command.noGate, command.keep, filter};
}

LayersOutput outputNamed(const std::string& text) {
  return text == "layer-bins" ? LayersOutput::LayerBins
         : text == "layers"   ? LayersOutput::Layers
         : text == "flat"     ? LayersOutput::Flat
                              : LayersOutput::Bins;
}

// Frames that ought to be there and are not; true where that is a failure.
bool reportMissing(const DenoiseCommand& command, const Sequence& sequence) {
  if (sequence.missing.empty()) return false;
  const bool failure = command.missing == "fail";
  fmt::print(stderr, "{}{}: {} missing: {}\n", failure ? "fathom: " : "", sequence.pattern.text(),
             sequence.missing.size() == 1 ? "frame" : "frames", describeFrames(sequence.missing));
  return failure;
}

void runDenoise(const DenoiseCommand& command) {
  DenoiseRequest request = command.request;
  if (request.layers.output != LayersOutput::Bins && request.base.name != kLayersBase)
    usage("--as", fmt::format("expected --method layers with it, found {}", request.base.name));
  request.params = paramsOf(command);
  const Interrupt interrupt;
  const int threads = command.threads > 0 ? command.threads : int(std::max(1u, std::thread::hardware_concurrency()));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
  if (!command.frames.empty() && !parsePattern(request.input).numbered())
    usage("--frames", fmt::format("expected a sequence such as name.####.exr, found {}", request.input));

  const auto start = std::chrono::steady_clock::now();
  const Sequence sequence = findSequence(request.input, command.frames);
  DenoiseJob job = makeDenoiseJob(request, sequence, threads > 1);
  job.stats = !command.stats.empty();
  for (const std::string& note : job.plan.notes) fmt::print(stderr, "{}\n", note);
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
  const auto isTime = [](const std::string& text) {
    double seconds = 0;
    const bool number = CLI::detail::lexical_cast(text, seconds) && std::isfinite(seconds) && seconds > 0;
    return number ? std::string() : fmt::format("expected seconds above 0, found {}", text);
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
  option("IN", command->request.input, "", "EXR file, or a sequence: name.####.exr, name.%04d.exr")
      ->required()
      ->check(understood(parsePattern));
  option("-o,--output", command->request.output, "OUT", "Where the result goes, numbered as IN is")
      ->required()
      ->check(understood(parsePattern));
  option("--flat", command->request.flattened, "OUT2", "Also write the flattened result");
  sub->add_flag("--split", command->request.split,
                "Also write diffuse and specular each to a file beside OUT (which holds both as channels)");
  CLI::Option* quality = option("--quality", command->quality, "fast|balanced|best",
                                "fast takes three quarters of the time of balanced, best two and a half times as much")
                             ->check(CLI::IsMember({"fast", "balanced", "best"}).description(""))
                             ->default_str(command->quality);
  CLI::Option* filter =
      option(
          "--filter", command->filter, "own|paper|rdfc",
          "Fathom's own filter, or a published one to compare with, without qualities, gate and guide: that of Vicini "
          "et al., or RDFC, as far as it is known here")
          ->check(CLI::IsMember({"own", "paper", "rdfc"}).description(""))
          ->default_str(command->filter);
  option(
      "--time-budget", command->budget, "SECONDS",
      "Choose the quality, and the guide or the method where none is named, for so much work on a frame, reading and "
      "writing aside; once for a sequence, whose outputs record it")
      ->check(CLI::Validator(isTime, ""))
      ->excludes(quality)
      ->excludes(filter);
  addBaseOptions(*sub, command->request.base);
  option("--layers", command->request.layers.count, "1|2|4", "How many layers --method layers splits a frame into")
      ->check(CLI::IsMember({1, 2, 4}).description(""))
      ->default_str("2");
  sub->add_option_function<std::string>(
         "--as", [command](const std::string& text) { command->request.layers.output = outputNamed(text); },
         "What --method layers makes OUT: the bins of IN, guided by its flat frame; the bins of IN in the colours of "
         "their layers; a deep file of a sample for each layer; or the flat frame")
      ->type_name("bins|layer-bins|layers|flat")
      ->check(CLI::IsMember({"bins", "layer-bins", "layers", "flat"}).description(""))
      ->default_str("bins");
  option("--flat-guide", command->request.guide, "auto|nlm|neural|oidn|layers|none|FILE",
         "What the bins of a deep IN shall add up to, a denoised flat frame: of Fathom's own filter, of its network or "
         "Open Image Denoise, which also help with the bins, or in a file; auto is none for fast, else oidn where "
         "that is installed, else layers up to 8 samples a pixel, and neural")
      ->default_str(command->request.guide);
  sub->add_flag("--error", command->request.errors,
                "Also write the estimated squared errors of the colours as error.{R,G,B}, of deep frames those of the "
                "flattened ones (three times the work; none for flat frames with half buffers and --method nlm)");
  sub->add_flag("--no-gate", command->noGate, "The denoiser alone: what it damages is not taken back");
  sub->add_flag("--keep", command->keep, "Keep half buffers, variances and counts in OUT");
  option("--frames", command->frames, "RANGE", "1-100, 1-100x2 or 1,3,5-9 (default: all that are on disk)")
      ->check(understood(parseFrames));
  option("--frames-missing", command->missing, "skip|fail", "Whether a missing frame is a failure; the others are done")
      ->check(CLI::IsMember({"skip", "fail"}).description(""))
      ->default_str(command->missing);
  option("--part", command->request.part, "PART", "Part of IN, by number or name (default: the first deep one)");
  option("--map", command->request.map, "FILE",
         fmt::format("Channel names of another renderer: lines such as albedo = diffuse_albedo, or one of: {}",
                     fmt::join(presetNames(), ", ")));
  option("--features", command->request.features, "FILE", "Deep or flat file with the albedo.* and N.* that IN lacks");
  option("--half", command->request.halves, "A B",
         "Renders from the even and from the odd camera samples, where IN has no half0.*")
      ->expected(2);
  option("--alpha", command->request.alpha, "FILE",
         "Deep render of many more camera samples, whose alphas the bins of IN get");
  option("--threads", command->threads, "N", "How many threads (default: all)")
      ->check(CLI::Range(1, 1024).description(""));
  option("--memory", command->request.memory, "SIZE", "How much memory; larger frames go through in bands of rows")
      ->transform(CLI::AsSizeValue(false).description(""))
      ->default_str("8G");
  option("--stats", command->stats, "FILE", "Write times, counts and memory as JSON");
  sub->add_flag("--overwrite", command->request.overwrite, "Replace outputs that other settings or another input made");
  sub->callback([command, sub] {
    if (sub->count("--time-budget") > 0) command->request.timeBudget = command->budget;
    command->request.anyBase = sub->count("--method") == 0 || command->request.base.name == kAutoBase;
    runDenoise(*command);
  });
}

}  // namespace fathom::cli
