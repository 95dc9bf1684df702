#include "cli/frame_guide.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "cli/memory_limit.h"
#include "cli/method_choice.h"
#include "cli/model_files.h"
#include "deep/flat_nl_means.h"
#include "flat/io.h"
#include "flat/noise.h"
#include "flat/oidn.h"

namespace fathom::cli {

namespace {

constexpr int kRowsOfSample = 64;

// Bytes of a pixel, measured: the flattened frame's planes and what our filter, or a library's copies, take beside them;
// the pictures of bins; and what is left when the guide is made.
constexpr size_t kFlattenedBytes = 340, kPicturesBytes = 182, kKeptBytes = 112;
constexpr double kMostOfMemory = 0.75;  // that `auto` lets a guide of whole frames have

// A file that is denoised already, as a denoiser.
flat::Denoiser fileDenoiser(const std::string& path) {
  return [path](const flat::Image& noisy, const Progress&) {
    flat::Image guide = flat::read(path);
    const Box &found = guide.dataWindow, &expected = noisy.dataWindow;
    if (found != expected)
      fail("{}: expected the data window of the deep frame, ({}, {}) to ({}, {}), found ({}, {}) to ({}, {})", path,
           expected.x0, expected.y0, expected.x1 - 1, expected.y1 - 1, found.x0, found.y0, found.x1 - 1, found.y1 - 1);
    flat::Image result{found, guide.displayWindow, {}, {}};
    for (const char* name : flat::kRgbNames) {
      flat::Plane* plane = guide.find(name);
      if (!plane) fail("{}, channel {}: expected in a guide, found none", path, name);
      result.planes.push_back({name, std::move(plane->values)});
    }
    return result;
  };
}

// A frame's flat input from rows [y0, y1), read in pieces.
deep::GuideInput readInput(FrameSource& source, int y0, int y1, int rowsAtOnce, const deep::DenoisePlan& plan,
                           bool withBins) {
  std::set<std::string> told;
  std::optional<deep::GuideInput> result;
  for (int y = y0; y < y1; y += rowsAtOnce) {
    deep::GuideInput piece = deep::guideInput(source.read(y, std::min(y + rowsAtOnce, y1), told), plan, withBins);
    if (result)
      deep::appendRows(*result, piece);
    else
      result = std::move(piece);
  }
  return std::move(*result);
}

GuidePlan nlmGuide(const deep::DenoisePlan& plan) {
  return {{deep::flatNlMeans(deep::planFlattened(plan)), {}, deep::kOwnGuide}, false, "nlm"};
}

// With the frame's guides prefiltered or not; the pictures of bins are worth no prefilter (a hundredth less error for
// three times the time).
GuidePlan oidnGuide(const std::shared_ptr<const flat::OidnLibrary>& library, bool prefilter, size_t scratch) {
  flat::OidnParams params{.prefilterGuides = prefilter,
                          .scratchMegabytes = int(std::clamp<size_t>(scratch / 1'000'000, 1, 1'000'000))};
  flat::OidnParams bins = params;
  bins.prefilterGuides = false;
  return {{flat::oidn(library, params), flat::oidn(library, bins), {}},
          true,
          fmt::format("{} bins {}", flat::describeOidn(*library, params), flat::describeOidn(*library, bins)),
          oidnBytes};
}

// In bfloat16 where the processor multiplies it: half the time, and bins that are as good.
GuidePlan neuralGuide(const BaseOptions& options, deep::DenoisePlan plan, size_t scratch) {
  BaseOptions named = options;
  named.name = kNeuralBase;
  if (named.model.empty()) named.model = defaultModel(true);
  plan.params.quality = deep::Quality::Fast;
  const BaseDenoiser base = makeBase(named, plan, scratch);
  return {{base.denoise, base.denoise, deep::kNetworkGuide}, true, base.settings, base.bytes};
}

flat::Image sampleOf(FrameSource& source, const deep::DenoisePlan& plan) {
  const Box middle = middleOf(source.part().dataWindow);
  const deep::GuideInput input = readInput(source, middle.y0, middle.y1, kRowsOfSample, plan, false);
  return flat::crop(input.noisy, middle);
}

struct NamedGuide {
  const char *name, *who;
  GuidePlan plan;
};

NamedGuide bestGuide(std::vector<NamedGuide> guides, const deep::DenoisePlan& plan, FrameSource& source) {
  const flat::Image middle = sampleOf(source, plan);
  size_t best = 0;
  double least = 0;
  for (size_t i = 0; i < guides.size(); ++i) {
    const double error = expectedError(middle, guides[i].plan.denoisers.flattened, plan.level);
    if (i > 0 && !(error < least)) continue;
    best = i;
    least = error;
  }
  return std::move(guides[best]);
}

// The plan's denoisers, or one that reads the frame's files; for as long as both are there.
deep::GuideDenoisers denoisersOf(const GuidePlan& guide, const FrameInputs& inputs) {
  deep::GuideDenoisers denoisers = guide.denoisers;
  if (guide.flattened)
    denoisers.flattened = [&](const flat::Image&, const Progress& progress) {
      return guide.flattened(inputs, progress);
    };
  else if (!denoisers.flattened)
    denoisers.flattened = fileDenoiser(inputs.guide);
  return denoisers;
}

}  // namespace

bool canBeGuided(const deep::DenoiseInputs& inputs) {
  return inputs.variance || inputs.halves;
}

GuideBytes guideBytes(const GuidePlan& guide, size_t pixels, size_t memory) {
  if (!guide.wholeFrame) return {.madePerPixel = kFlattenedBytes};
  GuideBytes bytes{kFlattenedBytes, kKeptBytes, 0};
  if (guide.denoisers.bins) bytes.madePerPixel += kPicturesBytes;
  if (guide.bytes) bytes.library = guide.bytes(pixels, decodedLimit(memory));
  return bytes;
}

bool guideFits(const GuidePlan& guide, size_t pixels, size_t memory) {
  const GuideBytes bytes = guideBytes(guide, pixels, memory);
  const size_t all = pixels * (bytes.madePerPixel + bytes.keptPerPixel) + bytes.library;
  return double(all) <= kMostOfMemory * double(workingBytes(memory));
}

bool guideFits(const std::string& choice, const BaseOptions& base, const deep::DenoisePlan& plan, size_t pixels,
               size_t memory) {
  const size_t scratch = decodedLimit(memory);
  if (choice == kNeuralBase) return guideFits(neuralGuide(base, plan, scratch), pixels, memory);
  if (choice == kOidnBase) return guideFits(oidnGuide(flat::loadOidn(base.oidnLibrary), true, scratch), pixels, memory);
  return true;
}

std::optional<GuidePlan> planGuide(const std::string& choice, const BaseOptions& base, const deep::DenoisePlan& plan,
                                   FrameSource& source, size_t memory, std::set<std::string>& notes) {
  if (choice == "none" || (choice == "auto" && plan.params.filter != deep::FilterKind::Own)) return {};
  if (!canBeGuided(plan.inputs)) {
    if (choice == "auto") return {};
    fail("{}: expected variance.* or half0.* and half1.* for --flat-guide, found neither", source.path());
  }
  const size_t scratch = decodedLimit(memory);
  if (choice == kOwnBase) return nlmGuide(plan);
  if (choice == kNeuralBase) return neuralGuide(base, plan, scratch);
  if (choice != "auto" && choice != kOidnBase) return GuidePlan{{}, true, "file"};
  if (choice == "auto" && plan.params.quality == deep::Quality::Fast) return {};
  std::vector<NamedGuide> guides;
  if (const auto library = choice == kOidnBase ? flat::loadOidn(base.oidnLibrary) : findOidn(base.oidnLibrary)) {
    guides.push_back({"oidn with prefiltered guides", "Open Image Denoise", oidnGuide(library, true, scratch)});
    guides.push_back({"oidn", "Open Image Denoise", oidnGuide(library, false, scratch)});
  }
  if (choice == "auto" && (base.name == kAutoBase || guides.empty()) && hasModel(base))
    guides.push_back({"the network", "the network", neuralGuide(base, plan, scratch)});
  std::erase_if(guides, [&](const NamedGuide& guide) {
    if (choice != "auto" || guideFits(guide.plan, source.part().dataWindow.area(), memory)) return false;
    notes.insert(
        fmt::format("{}: no guide by {}: whole frames of it take more than the memory", source.path(), guide.who));
    return true;
  });
  if (guides.empty()) return plan.params.quality == deep::Quality::Best ? std::optional(nlmGuide(plan)) : std::nullopt;
  if (guides.size() == 1) return std::move(guides.front().plan);
  NamedGuide best = bestGuide(std::move(guides), plan, source);
  notes.insert(fmt::format("{}: bins are guided by {}, which promises the least error", source.path(), best.name));
  return std::move(best.plan);
}

deep::BaseGuide guideOf(const deep::DeepImage& image, const GuidePlan& guide, const FrameInputs& inputs,
                        const deep::DenoisePlan& plan, const Progress& progress) {
  const deep::GuideDenoisers denoisers = denoisersOf(guide, inputs);
  return deep::makeGuide(deep::guideInput(image, plan, bool(denoisers.bins)), denoisers, plan, progress);
}

deep::BaseGuide readGuide(FrameSource& source, int rowsAtOnce, const GuidePlan& guide, const FrameInputs& inputs,
                          const deep::DenoisePlan& plan) {
  const Box& window = source.part().dataWindow;
  const deep::GuideDenoisers denoisers = denoisersOf(guide, inputs);
  return deep::makeGuide(readInput(source, window.y0, window.y1, rowsAtOnce, plan, bool(denoisers.bins)), denoisers,
                         plan, {});
}

}  // namespace fathom::cli
