#include "cli/progressive_job.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <set>

#include "base/error.h"
#include "cli/claim.h"
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

// A denoiser of the request. None but its name: our own filter, which is decided by the quality and each image.
struct NamedBase {
  std::string name;
  std::optional<BaseDenoiser> common;  // of all images
};

flat::Estimator estimatorOf(const ProgressiveRequest& request, const NamedBase& base, const flat::Image& noisy) {
  const deep::DenoisePlan plan = planOf(request, noisy);
  if (request.probes == 0 && !base.common && deep::tellsResponse(plan)) return deep::nlMeansEstimator(plan);
  flat::SureParams params;
  if (request.probes > 0) params.probes = request.probes;
  return flat::byProbes(base.common ? base.common->denoise : deep::flatNlMeans(plan), params);
}

std::vector<NamedBase> basesOf(const ProgressiveRequest& request, const std::string& names) {
  std::vector<NamedBase> bases;
  deep::DenoisePlan plan;
  plan.params = {.quality = request.quality, .gate = false};
  for (const std::string& name : baseNames(names)) {
    NamedBase& base = bases.emplace_back(NamedBase{name, {}});
    if (name == kOwnBase) continue;
    BaseOptions options = request.base;
    options.name = name;
    base.common = makeBase(options, plan, scratchOf(request.memory));
  }
  return bases;
}

// All that decides what comes out, beside the contents of the inputs.
std::string describeSettings(const ProgressiveRequest& request, const std::vector<NamedBase>& bases,
                             const std::string& mix, const SourceOptions& source) {
  std::string text =
      fmt::format("progressive mix {} quality {} probes {} errors {} features {} halves {}", mix, int(request.quality),
                  request.probes, request.errors, !request.features.empty(), request.halves.size());
  for (const NamedBase& base : bases) text += " base " + (base.common ? base.common->settings : base.name);
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

FilePattern outputPattern(const std::string& option, const std::string& path, const FilePattern& input) {
  FilePattern pattern = parsePattern(path);
  if (!path.ends_with(".exr"))
    throw CLI::ValidationError(option, fmt::format("expected a name that ends in .exr, found {}", path));
  if (pattern.numbered() != input.numbered())
    throw CLI::ValidationError(option, fmt::format("expected a {} name like the input's, found {}",
                                                   input.numbered() ? "numbered" : "plain", path));
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

// All candidates as one image, with the attributes of `output`.
flat::Image candidatesOf(const flat::Image& output, const std::vector<NamedBase>& bases,
                         std::vector<flat::Candidate> candidates) {
  flat::Image image{output.dataWindow, output.displayWindow, {}, output.attributes};
  for (size_t n = 0; n < candidates.size(); ++n) {
    flat::Candidate& from = candidates[n];
    const auto put = [&](const std::string& what, Buffer<float>& values) {
      image.planes.push_back({bases[n].name + "." + what, std::move(values)});
    };
    for (size_t c = 0; c < 3; ++c) {
      const std::string channel = flat::kRgbNames[c];
      put(channel, from.denoised.find(channel)->values);
      put("error." + channel, from.map.error[c]);
      put("variance." + channel, from.map.variance[c]);
      put("covariance." + channel, from.map.covariance[c]);
      put("spread." + channel, from.spread[c]);
    }
    put("gate", from.k);
  }
  return image;
}

// Two of the render, one of them moved along its noise; its noise and the mix; and of each denoiser its result and what is
// estimated of it.
size_t imageBytes(const flat::Image& noisy, size_t denoisers) {
  constexpr size_t kPixel = 16 * sizeof(float), kCandidate = 24 * sizeof(float);
  return noisy.dataWindow.area() * (2 * noisy.planes.size() * sizeof(float) + kPixel + denoisers * kCandidate);
}

void expectMemory(const std::string& file, const flat::Image& noisy, const std::vector<NamedBase>& bases,
                  size_t memory) {
  const auto bytes = [&](size_t limit) {
    size_t most = 0;
    for (const NamedBase& base : bases)
      if (base.common && base.common->bytes)
        most = std::max(most, base.common->bytes(noisy.dataWindow.area(), scratchOf(limit)));
    return imageBytes(noisy, bases.size()) + most;
  };
  if (bytes(memory) > workingBytes(memory))
    fail("{}: expected at least {} MB of memory for it and its denoiser, found a limit of {} MB", file,
         memoryThatSuffices(memory, bytes) / 1'000'000 + 1, memory / 1'000'000);
}

class ProgressiveRun {
 public:
  // `passes`: all that there are, of which the first that can be read decides what is left open.
  // `claims`: other processes may work on the same passes.
  ProgressiveRun(const ProgressiveRequest& request, const std::vector<FrameInputs>& passes, bool claims,
                 ProgressSink& display, const std::stop_token& stop)
      : request_(request), claims_(claims), display_(display), stop_(stop) {
    if (!request.map.empty()) options_.map = readChannelMap(request.map);
    options_.memory = request.memory;
    bases_ = basesOf(request, request.base.name == kAutoBase ? chooseBase(passes) : request.base.name);
    const MixChoice mix = mixOf(request.base);
    params_.net = mix.net;
    settings_ = describeSettings(request, bases_, mix.settings, options_);
  }

  // `candidates`: a file for them, or none.
  PassReport run(const FrameInputs& inputs, const std::string& output, const std::string& candidates) {
    PassReport report;
    report.input = inputs.main;
    report.output = output;
    const Stopwatch watch;
    try {
      work(inputs, candidates, report);
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

  // Whether the output is there. Throws Error where something else is.
  bool isDone(const std::string& output, const std::string& madeBy) const {
    const Standing standing = standingOf(output, kMadeBy, madeBy);
    if (standing == Standing::Other && !request_.overwrite)
      fail(
          "{}: expected nothing there, or what these settings make of this input; found another file (--overwrite "
          "replaces it)",
          output);
    return standing == Standing::Ours;
  }

  // Whoever needs what is estimated works on a pass that is there or that another process makes, too, and writes it if
  // nobody else has.
  void work(const FrameInputs& inputs, const std::string& candidateFile, PassReport& report) {
    ContentHash hash;
    for (const std::string& text : {std::string(FATHOM_VERSION), settings_}) hash.add(text);
    for (const std::string& file : inputs.files()) hash.addFile(file);
    const std::string madeBy = fmt::format("fathom {} {:016x}", FATHOM_VERSION, hash.value());
    const bool needed = request_.estimates || !candidateFile.empty();
    std::shared_ptr<const Claim> claim;
    if (isDone(report.output, madeBy)) {
      if (claims_) Claim::clear({report.output});
      if (!needed) report.status = PassReport::Status::Kept;
    } else if (claims_ && !needed) {
      claim = Claim::take({report.output});
      if (!claim)
        report.status = PassReport::Status::Elsewhere;
      else if (isDone(report.output, madeBy))
        report.status = PassReport::Status::Kept;
    }
    if (report.status != PassReport::Status::Done) return;
    flat::Image noisy = read(inputs);
    expectMemory(inputs.main, noisy, bases_, request_.memory);
    const flat::Noise noise = flat::noiseOf(noisy);
    const Progress progress{[&](double done) { display_.at(done); }, stop_};
    std::vector<flat::Estimator> estimators;
    for (const NamedBase& base : bases_) estimators.push_back(estimatorOf(request_, base, noisy));
    std::vector<flat::Candidate> candidates = flat::makeCandidates(noisy, noise, estimators, {}, progress);
    flat::Image mixed = flat::mixCandidates(noisy, noise, candidates, params_);
    report.errors = flat::summarizeErrors(mixed, noise);
    report.spp = flat::sppOf(noisy);
    flat::Image output = outputOf(std::move(noisy), std::move(mixed), request_.errors);
    output.attributes[kMadeBy] = madeBy;
    if (!candidateFile.empty()) flat::write(candidateFile, candidatesOf(output, bases_, std::move(candidates)));
    if (claims_ && needed) claim = Claim::take({report.output});
    if ((claim || !claims_) && !isDone(report.output, madeBy)) flat::write(report.output, output);
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
  const bool claims_;
  ProgressSink& display_;
  const std::stop_token stop_;
  SourceOptions options_;
  std::vector<NamedBase> bases_;
  flat::ProgressiveParams params_;
  std::string settings_;
  std::set<std::string> told_;
};

}  // namespace

std::vector<PassReport> runProgressive(const ProgressiveRequest& request, const Sequence& sequence,
                                       ProgressSink& display, const std::stop_token& stop,
                                       const std::function<void(const PassReport&)>& done) {
  const FilePattern output = outputPattern("-o", request.output, sequence.pattern);
  const auto candidatesAt = [&](int frame) {
    if (request.candidates.empty()) return std::string();
    return outputPattern("--candidates", request.candidates, sequence.pattern).at(frame);
  };
  for (const int frame : sequence.frames) {
    const FrameInputs inputs = inputsAt(request, sequence.pattern, frame);
    expectOtherThan(inputs, output.at(frame));
    expectOtherThan(inputs, candidatesAt(frame));
  }
  std::vector<FrameInputs> passes;
  for (const int frame : sequence.pattern.numbered() ? framesOnDisk(sequence.pattern) : sequence.frames)
    passes.push_back(inputsAt(request, sequence.pattern, frame));
  ProgressiveRun run(request, passes, sequence.pattern.numbered(), display, stop);
  std::map<int, PassReport> reports;
  std::vector<int> frames = sequence.frames;
  for (size_t i = 0; i < frames.size(); ++i) {
    if (stop.stop_requested()) throw Cancelled();
    const int frame = frames[i];
    PassReport report = run.run(inputsAt(request, sequence.pattern, frame), output.at(frame), candidatesAt(frame));
    report.pass = frame;
    if (report.status == PassReport::Status::Elsewhere && i < sequence.frames.size()) {
      frames.push_back(frame);
      continue;
    }
    done(report);
    reports[frame] = std::move(report);
  }
  std::vector<PassReport> inOrder;
  for (auto& [frame, report] : reports) inOrder.push_back(std::move(report));
  return inOrder;
}

}  // namespace fathom::cli
