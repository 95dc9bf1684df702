// `fathom progressive`: its options, and what they make of the passes of a growing render.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <optional>
#include <thread>

#include "base/error.h"
#include "cli/channel_map.h"
#include "cli/commands.h"
#include "cli/interrupt.h"
#include "cli/progress_display.h"
#include "cli/progressive_job.h"
#include "cli/progressive_report.h"

namespace fathom::cli {

namespace {

struct ProgressiveCommand {
  ProgressiveRequest request;
  std::string frames, report;
  std::string quality = "balanced";
  std::optional<double> target;
  int threads = 0;  // 0: all
};

constexpr const char* kFooter = R"(
IN is a flat render with variance.{R,G,B} or half buffers, or several of one frame with ever more samples per pixel; the
number is that of the pass. Each gets a result: denoised colours where denoising helps, the render where it does not.
OUT has IN's other channels, but no components, half buffers, variances and counts.

Errors are estimates of the relMSE against the truth, (a-r)^2/(r^2+0.01), without knowing it.

Exit status: 0 all files done, 1 some failed (one line each), 2 usage, 130 stopped.)";

deep::Quality qualityOf(const std::string& name) {
  return name == "fast" ? deep::Quality::Fast : name == "best" ? deep::Quality::Best : deep::Quality::Balanced;
}

std::string describe(const PassReport& report) {
  if (report.status == PassReport::Status::Kept) return fmt::format("{}: done before", report.output);
  if (report.status == PassReport::Status::Elsewhere) return fmt::format("{}: another process is at it", report.output);
  return fmt::format("{}: {}estimated relMSE {:.5f}, of the render {:.5f}, {:.1f} s", report.output,
                     report.spp > 0 ? fmt::format("{} spp, ", report.spp) : "", report.errors.relMse,
                     report.errors.render, report.seconds);
}

void tellTarget(const PassReport& report, double target, ProgressDisplay& display) {
  const auto& tiles = report.errors.tiles;
  const auto left = std::ranges::count_if(tiles, [&](const auto& tile) { return tile.relMse > target; });
  display.say(fmt::format("{}: estimated relMSE {:.5f} is within {}: stop rendering here ({} of {} tiles are above it)",
                          report.input, report.errors.relMse, target, left, tiles.size()));
}

void runCommand(const ProgressiveCommand& command) {
  ProgressiveRequest request = command.request;
  request.quality = qualityOf(command.quality);
  request.estimates = command.target || !command.report.empty();
  const Interrupt interrupt;
  const int threads = command.threads > 0 ? command.threads : int(std::max(1u, std::thread::hardware_concurrency()));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
  if (!command.frames.empty() && !parsePattern(request.input).numbered())
    throw CLI::ValidationError("--frames",
                               fmt::format("expected a sequence such as name.####.exr, found {}", request.input));
  const Sequence sequence = findSequence(request.input, command.frames);
  std::vector<PassReport> reports;
  {
    ProgressDisplay display(sequence.frames.size());
    int last = 0, lastSpp = 0;
    bool told = false;
    reports = runProgressive(request, sequence, display, interrupt.token(), [&](const PassReport& report) {
      if (report.status == PassReport::Status::Failed) {
        display.tell("fathom: " + report.error);
        return display.frameDone("");
      }
      display.frameDone(describe(report));
      if (report.spp > 0 && report.spp <= lastSpp && report.pass > last)
        display.tell(fmt::format("{}: expected more than the {} samples per pixel of the pass before, found {}",
                                 report.input, lastSpp, report.spp));
      last = report.pass;
      lastSpp = report.spp;
      if (reaches(report, command.target) && !told) tellTarget(report, *command.target, display);
      told = told || reaches(report, command.target);
    });
    if (command.target && !told) display.say(fmt::format("no pass is within {}: render on", *command.target));
  }
  if (!command.report.empty()) writeProgressiveReport(command.report, reports, command.target);
  if (std::ranges::any_of(reports, [](const auto& r) { return r.status == PassReport::Status::Failed; }))
    throw Incomplete();
}

}  // namespace

void addProgressive(CLI::App& app) {
  auto command = std::make_shared<ProgressiveCommand>();
  CLI::App* sub =
      app.add_subcommand("progressive", "Denoise a growing render as long as that helps, and tell its error");
  sub->footer(kFooter);
  const auto option = [&](const char* name, auto& value, const char* type, const std::string& text) {
    return sub->add_option(name, value, text)->type_name(type);
  };
  ProgressiveRequest& request = command->request;
  option("IN", request.input, "", "Flat EXR file, or passes of growing spp: name.####.exr, name.%04d.exr")->required();
  option("-o,--output", request.output, "OUT", "Where the result goes, numbered as IN is")->required();
  addBaseOptions(*sub, request.base);
  option("--quality", command->quality, "fast|balanced|best", "Of the denoiser, as in fathom denoise")
      ->check(CLI::IsMember({"fast", "balanced", "best"}).description(""))
      ->default_str(command->quality);
  option(
      "--probes", request.probes, "N",
      "Runs of the denoiser that measure its error, beside the first (default: none for nlm where IN has half buffers, "
      "which it tells its error by; else 2)")
      ->check(CLI::Range(1, 64).description(""));
  sub->add_flag("--error", request.errors, "Also write the estimated squared errors as error.{R,G,B}");
  option("--candidates", request.candidates, "OUT2",
         "Also write what each denoiser made, as nlm.{R,G,B}, and what is known of it: nlm.error.*, nlm.variance.* (of "
         "the render) and nlm.covariance.* (of both), all smoothed, nlm.spread.* and nlm.gate");
  option("--target", command->target, "ERROR", "Say which pass is the first with an estimated relMSE within this")
      ->check(CLI::PositiveNumber.description(""));
  option("--report", command->report, "FILE", "Write the estimates as JSON, of frames and of tiles of 64x64 pixels");
  option("--frames", command->frames, "RANGE", "Passes: 1-100, 1-100x2 or 1,3,5-9 (default: all that are on disk)");
  option("--map", request.map, "FILE",
         fmt::format("Channel names of another renderer: lines such as albedo = diffuse_albedo, or one of: {}",
                     fmt::join(presetNames(), ", ")));
  option("--features", request.features, "FILE", "Flat file with the albedo.* and N.* that IN lacks");
  option("--half", request.halves, "A B",
         "Renders from the even and from the odd camera samples, where IN has no half0.*")
      ->expected(2);
  option("--threads", command->threads, "N", "How many threads (default: all)")
      ->check(CLI::Range(1, 1024).description(""));
  option("--memory", request.memory, "SIZE", "How much memory a decoded file may take")
      ->transform(CLI::AsSizeValue(false).description(""))
      ->default_str("8G");
  sub->add_flag("--overwrite", request.overwrite, "Replace outputs that other settings or another input made");
  sub->callback([command] { runCommand(*command); });
}

}  // namespace fathom::cli
