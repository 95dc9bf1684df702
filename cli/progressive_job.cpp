#include "cli/progressive_job.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <new>
#include <optional>
#include <set>

#include "base/error.h"
#include "cli/content_hash.h"
#include "cli/frame_sink.h"
#include "cli/frame_source.h"
#include "cli/memory_limit.h"
#include "cli/method_choice.h"
#include "cli/stopwatch.h"
#include "deep/flat_nl_means.h"
#include "deep/noise_response.h"
#include "deep/one_bin.h"
#include "flat/io.h"
#include "flat/progressive.h"

namespace fathom::cli {

namespace {

// What a library or network may work in.
size_t scratchOf(size_t memory) {
  return memory / 2;
}

// The mix has a gate of its own.
deep::DenoisePlan planOf(const ProgressiveRequest& request, const flat::Image& noisy) {
  return deep::planFlat(noisy, {.quality = request.quality, .gate = false});
}

// The mix of the render and what its base, our own filter where there is none, makes of it.
flat::Image mixOf(const ProgressiveRequest& request, const std::optional<BaseDenoiser>& base, const flat::Image& noisy,
                  const flat::Noise& noise, const Progress& progress) {
  const deep::DenoisePlan plan = planOf(request, noisy);
  if (request.probes == 0 && !base && deep::tellsResponse(plan)) {
    deep::FlatAnswer answer = deep::answerNlMeans(noisy, plan, progress);
    return flat::mixByEstimate(noisy, noise, answer.denoised,
                               flat::estimateError(noisy, noise, answer.denoised, std::move(answer.response)));
  }
  flat::ProgressiveParams params;
  if (request.probes > 0) params.sure.probes = request.probes;
  return flat::denoiseProgressively(noisy, base ? base->denoise : deep::flatNlMeans(plan), params, progress);
}

// What is the base of all images; none: our own filter, which is decided by the quality and each image.
std::optional<BaseDenoiser> commonBase(const ProgressiveRequest& request, const BaseOptions& options) {
  if (options.name == kOwnBase) return {};
  deep::DenoisePlan plan;
  plan.params.quality = request.quality;
  return makeBase(options, plan, scratchOf(request.memory));
}

// All that decides what comes out, beside the contents of the inputs.
std::string describeSettings(const ProgressiveRequest& request, const std::optional<BaseDenoiser>& base,
                             const SourceOptions& source) {
  std::string text = fmt::format("progressive base {} quality {} probes {} errors {} features {} halves {}",
                                 base ? base->settings : kOwnBase, int(request.quality), request.probes, request.errors,
                                 !request.features.empty(), request.halves.size());
  if (source.map)
    for (const ChannelMap::Line& line : source.map->lines) {
      text += fmt::format("\n{} ={}", line.ours, line.unpremultiplied ? " unpremultiplied" : "");
      for (const ChannelMap::Term& term : line.terms) text += fmt::format(" {} {}", term.sign, term.theirs);
    }
  return text;
}

FrameInputs inputsAt(const ProgressiveRequest& request, const FilePattern& input, int frame) {
  const auto at = [&](const std::string& path) { return path.empty() ? path : parsePattern(path).at(frame); };
  FrameInputs inputs{input.at(frame), at(request.features), {}, {}, {}};
  for (size_t i = 0; i < request.halves.size(); ++i) inputs.halves[i] = at(request.halves[i]);
  return inputs;
}

FilePattern outputPattern(const ProgressiveRequest& request, const FilePattern& input) {
  FilePattern pattern = parsePattern(request.output);
  if (!request.output.ends_with(".exr"))
    throw CLI::ValidationError("-o", fmt::format("expected a name that ends in .exr, found {}", request.output));
  if (pattern.numbered() != input.numbered())
    throw CLI::ValidationError("-o", fmt::format("expected a {} name like the input's, found {}",
                                                 input.numbered() ? "numbered" : "plain", request.output));
  return pattern;
}

void expectOtherThan(const FrameInputs& inputs, const std::string& output) {
  for (const std::string& input : inputs.files()) {
    std::error_code none;
    if (input == output || std::filesystem::equivalent(input, output, none))
      throw CLI::ValidationError("-o", fmt::format("expected another file than the input {}", input));
  }
}

// What describes the noisy colours, or does not sum up to the new ones.
bool isOfRender(const std::string& name) {
  return name.starts_with("half0.") || name.starts_with("half1.") || name.starts_with("variance.") ||
         name.starts_with("diffuse.") || name.starts_with("specular.") || name.starts_with("error.") ||
         name == "samples";
}

// The render with the colours of `mixed`.
flat::Image outputOf(flat::Image noisy, flat::Image mixed, bool errors) {
  std::erase_if(noisy.planes, [](const flat::Plane& plane) { return isOfRender(plane.name); });
  for (flat::Plane& plane : mixed.planes) {
    if (flat::Plane* to = noisy.find(plane.name))
      to->values = std::move(plane.values);
    else if (errors)
      noisy.planes.push_back(std::move(plane));
  }
  return noisy;
}

// Two of the render, one of them moved along its noise; its noise, the denoised, the estimates and the mix.
size_t imageBytes(const flat::Image& noisy) {
  constexpr size_t kPixel = 40 * sizeof(float);
  return noisy.dataWindow.area() * (2 * noisy.planes.size() * sizeof(float) + kPixel);
}

void expectMemory(const std::string& file, const flat::Image& noisy, const std::optional<BaseDenoiser>& base,
                  size_t memory) {
  if (!base || !base->bytes) return;
  const auto bytes = [&](size_t limit) {
    return imageBytes(noisy) + base->bytes(noisy.dataWindow.area(), scratchOf(limit));
  };
  if (bytes(memory) > workingBytes(memory))
    fail("{}: expected at least {} MB of memory for it and its denoiser, found a limit of {} MB", file,
         memoryThatSuffices(memory, bytes) / 1'000'000 + 1, memory / 1'000'000);
}

class ProgressiveRun {
 public:
  // `passes`: all that there are, of which the first that can be read decides what is left open.
  ProgressiveRun(const ProgressiveRequest& request, const std::vector<FrameInputs>& passes, ProgressSink& display,
                 const std::stop_token& stop)
      : request_(request), display_(display), stop_(stop) {
    if (!request.map.empty()) options_.map = readChannelMap(request.map);
    options_.memory = request.memory;
    BaseOptions base = request.base;
    if (base.name == kAutoBase) base.name = chooseBase(passes);
    base_ = commonBase(request, base);
    settings_ = describeSettings(request, base_, options_);
  }

  PassReport run(const FrameInputs& inputs, const std::string& output) {
    PassReport report;
    report.input = inputs.main;
    report.output = output;
    const Stopwatch watch;
    try {
      work(inputs, report);
    } catch (const Cancelled&) {
      throw;
    } catch (const std::bad_alloc&) {
      report.error = fmt::format("{}: out of memory", inputs.main);
    } catch (const std::exception& e) {
      std::vector<std::string> files = inputs.files();
      files.push_back(output);
      report.error = namingFile(oneLine(e.what()), files);
    }
    if (!report.error.empty()) report.status = PassReport::Status::Failed;
    report.seconds = watch.seconds();
    return report;
  }

 private:
  std::string chooseBase(const std::vector<FrameInputs>& passes) {
    for (const FrameInputs& inputs : passes) {
      flat::Image noisy;
      try {
        noisy = read(inputs);
      } catch (const Error&) {
        continue;  // its own run tells
      }
      const flat::Image middle = flat::crop(noisy, middleOf(noisy.dataWindow));
      const MethodChoice choice =
          chooseMethod(request_.base, middle, planOf(request_, noisy), {.scratch = scratchOf(request_.memory)});
      display_.tell(fmt::format("{}: denoised by {}, which {}", inputs.main, choice.name, choice.why));
      return choice.name;
    }
    return kOwnBase;
  }

  void work(const FrameInputs& inputs, PassReport& report) {
    ContentHash hash;
    for (const std::string& text : {std::string(FATHOM_VERSION), settings_}) hash.add(text);
    for (const std::string& file : inputs.files()) hash.addFile(file);
    const std::string madeBy = fmt::format("fathom {} {:016x}", FATHOM_VERSION, hash.value());
    const Standing standing = standingOf(report.output, kMadeBy, madeBy);
    if (standing == Standing::Other && !request_.overwrite)
      fail(
          "{}: expected nothing there, or what these settings make of this input; found another file (--overwrite "
          "replaces it)",
          report.output);
    if (standing == Standing::Ours && !request_.estimates) {
      report.status = PassReport::Status::Kept;
      return;
    }
    flat::Image noisy = read(inputs);
    expectMemory(inputs.main, noisy, base_, request_.memory);
    const flat::Noise noise = flat::noiseOf(noisy);
    const Progress progress{[&](double done) { display_.at(done); }, stop_};
    flat::Image mixed = mixOf(request_, base_, noisy, noise, progress);
    report.errors = flat::summarizeErrors(mixed, noise);
    report.spp = flat::sppOf(noisy);
    if (standing == Standing::Ours) return;
    flat::Image output = outputOf(std::move(noisy), std::move(mixed), request_.errors);
    output.attributes[kMadeBy] = madeBy;
    flat::write(report.output, output);
  }

  flat::Image read(const FrameInputs& inputs) {
    FrameSource source(inputs, options_);
    if (source.deep()) fail("{}: expected a flat file, found a deep one", inputs.main);
    std::set<std::string> notes;
    deep::DeepImage bins = source.read(notes);
    for (const std::string& note : notes)
      if (told_.insert(note).second) display_.tell(note);
    deep::unmakeOneBin(bins);
    flat::Image image = deep::toFlat(bins);
    image.attributes = source.flatAttributes();
    return image;
  }

  const ProgressiveRequest& request_;
  ProgressSink& display_;
  const std::stop_token stop_;
  SourceOptions options_;
  std::optional<BaseDenoiser> base_;
  std::string settings_;
  std::set<std::string> told_;
};

}  // namespace

std::vector<PassReport> runProgressive(const ProgressiveRequest& request, const Sequence& sequence,
                                       ProgressSink& display, const std::stop_token& stop,
                                       const std::function<void(const PassReport&)>& done) {
  const FilePattern output = outputPattern(request, sequence.pattern);
  for (const int frame : sequence.frames) expectOtherThan(inputsAt(request, sequence.pattern, frame), output.at(frame));
  std::vector<FrameInputs> passes;
  for (const int frame : sequence.pattern.numbered() ? framesOnDisk(sequence.pattern) : sequence.frames)
    passes.push_back(inputsAt(request, sequence.pattern, frame));
  ProgressiveRun run(request, passes, display, stop);
  std::vector<PassReport> reports;
  for (const int frame : sequence.frames) {
    if (stop.stop_requested()) throw Cancelled();
    reports.push_back(run.run(inputsAt(request, sequence.pattern, frame), output.at(frame)));
    done(reports.back());
  }
  return reports;
}

}  // namespace fathom::cli
