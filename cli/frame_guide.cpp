#include "cli/frame_guide.h"

#include <fmt/format.h>

#include <algorithm>

#include "cli/memory_limit.h"
#include "deep/flat_nl_means.h"
#include "flat/error.h"
#include "flat/io.h"
#include "flat/oidn.h"
#include "flat/sure.h"

namespace fathom::cli {

namespace {

constexpr int kSampleSide = 384;  // of the middle of the frame that `auto` looks at, pixels
constexpr int kRowsOfSample = 64;

// Bytes of a pixel, measured: the flattened frame's planes and what our filter, or a library's copies, take beside them;
// the pictures of bins; and what is left when the guide is made.
constexpr size_t kFlattenedBytes = 340, kPicturesBytes = 160, kKeptBytes = 112;
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
deep::GuideInput readInput(FrameSource& source, int y0, int y1, int rowsAtOnce, const deep::DenoiseInputs& inputs,
                           bool withBins) {
  std::set<std::string> told;
  std::optional<deep::GuideInput> result;
  for (int y = y0; y < y1; y += rowsAtOnce) {
    deep::GuideInput piece = deep::guideInput(source.read(y, std::min(y + rowsAtOnce, y1), told), inputs, withBins);
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
          fmt::format("{} bins {}", flat::describeOidn(*library, params), flat::describeOidn(*library, bins))};
}

// The expected squared error of a denoiser, relative to what it makes of the picture.
double expectedError(const flat::Image& noisy, const flat::Denoiser& denoise, float level) {
  const flat::Noise noise = flat::noiseOf(noisy);
  const flat::Image denoised = denoise(noisy, {});
  const flat::ErrorEstimate estimate = flat::estimateError(noisy, noise, denoised, denoise, {.probes = 1});
  const double dark = 0.04 * double(level) * double(level);  // 0.01 where the mean is 0.5, as in relMSE
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < denoised.planes[c].values.size(); ++i) {
      const double f = double(denoised.planes[c].values[i]);
      sum += double(estimate.error[c][i]) / (f * f + dark);
    }
  return sum;
}

flat::Image middleOf(FrameSource& source, const deep::DenoiseInputs& inputs) {
  const Box& window = source.part().dataWindow;
  const int width = std::min(kSampleSide, window.width()), height = std::min(kSampleSide, window.height());
  const int x0 = window.x0 + (window.width() - width) / 2, y0 = window.y0 + (window.height() - height) / 2;
  const deep::GuideInput input = readInput(source, y0, y0 + height, kRowsOfSample, inputs, false);
  return flat::crop(input.noisy, {x0, y0, x0 + width, y0 + height});
}

// Which way of Open Image Denoise.
GuidePlan bestGuide(const std::shared_ptr<const flat::OidnLibrary>& library, const deep::DenoisePlan& plan,
                    FrameSource& source, size_t scratch, std::string& name) {
  const flat::Image middle = middleOf(source, plan.inputs);
  GuidePlan best;
  double least = 0;
  const auto consider = [&](const char* called, GuidePlan guide) {
    const double error = expectedError(middle, guide.denoisers.flattened, plan.level);
    if (!name.empty() && !(error < least)) return;
    name = called;
    least = error;
    best = std::move(guide);
  };
  consider("oidn with prefiltered guides", oidnGuide(library, true, scratch));
  consider("oidn", oidnGuide(library, false, scratch));
  return best;
}

// Whether a guide of whole frames leaves memory for the frame `source` itself.
bool fits(const GuidePlan& guide, FrameSource& source, size_t memory) {
  const size_t pixels = source.part().dataWindow.area();
  const GuideBytes bytes = guideBytes(guide, pixels, memory);
  const size_t all = pixels * (bytes.madePerPixel + bytes.keptPerPixel) + bytes.library;
  return double(all) <= kMostOfMemory * double(workingBytes(memory));
}

// The plan's denoisers, or one that reads the frame's file.
deep::GuideDenoisers denoisersOf(const GuidePlan& guide, const FrameInputs& inputs) {
  deep::GuideDenoisers denoisers = guide.denoisers;
  if (!denoisers.flattened) denoisers.flattened = fileDenoiser(inputs.guide);
  return denoisers;
}

}  // namespace

bool canBeGuided(const deep::DenoiseInputs& inputs) {
  return inputs.variance || inputs.halves;
}

GuideBytes guideBytes(const GuidePlan& guide, size_t pixels, size_t memory) {
  if (!guide.wholeFrame) return {.madePerPixel = kFlattenedBytes};
  GuideBytes bytes{kFlattenedBytes, kKeptBytes, 0};
  if (guide.denoisers.bins) {
    bytes.madePerPixel += kPicturesBytes;
    bytes.library = oidnBytes(pixels, memory);
  }
  return bytes;
}

std::optional<GuidePlan> planGuide(const std::string& choice, const BaseOptions& base, const deep::DenoisePlan& plan,
                                   FrameSource& source, size_t memory, std::set<std::string>& notes) {
  if (choice == "none" || (choice == "auto" && plan.params.filter != deep::FilterKind::Own)) return {};
  if (!canBeGuided(plan.inputs)) {
    if (choice == "auto") return {};
    fail("{}: expected variance.* or half0.* and half1.* for --flat-guide, found neither", source.path());
  }
  if (choice == "nlm") return nlmGuide(plan);
  if (choice != "auto" && choice != "oidn") return GuidePlan{{}, true, "file"};
  if (choice == "auto" && plan.params.quality == deep::Quality::Fast) return {};
  const auto library = choice == "oidn" ? flat::loadOidn(base.oidnLibrary) : findOidn(base.oidnLibrary);
  const auto without = [&] {
    return plan.params.quality == deep::Quality::Best ? std::optional(nlmGuide(plan)) : std::nullopt;
  };
  if (!library) return without();
  const size_t scratch = decodedLimit(memory);
  if (choice == "auto" && !fits(oidnGuide(library, true, scratch), source, memory)) {
    notes.insert(
        fmt::format("{}: no guide by Open Image Denoise: whole frames of it take more than the memory", source.path()));
    return without();
  }
  std::string name;
  GuidePlan guide = bestGuide(library, plan, source, scratch, name);
  notes.insert(
      fmt::format("{}: bins are guided by {}, which promises less error than the other way", source.path(), name));
  return guide;
}

deep::BaseGuide guideOf(const deep::DeepImage& image, const GuidePlan& guide, const FrameInputs& inputs,
                        const deep::DenoisePlan& plan, const Progress& progress) {
  const deep::GuideDenoisers denoisers = denoisersOf(guide, inputs);
  return deep::makeGuide(deep::guideInput(image, plan.inputs, bool(denoisers.bins)), denoisers, plan.level, progress);
}

deep::BaseGuide readGuide(FrameSource& source, int rowsAtOnce, const GuidePlan& guide, const FrameInputs& inputs,
                          const deep::DenoisePlan& plan) {
  const Box& window = source.part().dataWindow;
  const deep::GuideDenoisers denoisers = denoisersOf(guide, inputs);
  return deep::makeGuide(readInput(source, window.y0, window.y1, rowsAtOnce, plan.inputs, bool(denoisers.bins)),
                         denoisers, plan.level, {});
}

}  // namespace fathom::cli
