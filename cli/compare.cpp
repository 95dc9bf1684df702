// `fathom compare`: how far images are from their references, as a table or as JSON.
//
// What is measured is kept as JSON, one object a frame; the table and the mean over the frames are made from that.
#include <charconv>
#include <memory>
#include <optional>

#include "base/error.h"
#include "cli/commands.h"
#include "cli/compare_report.h"
#include "cli/load_image.h"
#include "cli/sequence.h"
#include "deep/compare.h"
#include "deep/flatten.h"
#include "deep/tidy.h"
#include "flat/heatmap.h"
#include "flat/io.h"
#include "flat/metrics.h"

namespace fathom::cli {

namespace {

using nlohmann::ordered_json;

struct CompareParams {
  std::string image, reference;
  std::string frames;              // empty: those on disk
  bool correct = false;            // subtract the reference's own error
  std::string noisy;               // the frame with the noise that the reference has less of; empty: none
  std::vector<std::string> clips;  // depths, or "median"
  bool asJson = false;
  std::string heatmap;  // empty: none
};

struct FlatPair {
  flat::Image image, reference;
};

bool isCompared(const std::string& name) {
  for (const char* used : {"R", "G", "B", "samples", "variance.R", "variance.G", "variance.B"})
    if (name == used) return true;
  return false;
}

std::vector<float> clipDepths(const CompareParams& params, const deep::DeepImage& reference) {
  std::vector<float> depths;
  for (const std::string& text : params.clips) {
    float depth = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), depth);
    if (text == "median")
      depth = deep::medianDepth(reference);
    else if (error != std::errc() || end != text.data() + text.size())
      fail("--clip: expected a depth or `median`, found `{}`", text);
    depths.push_back(depth);
  }
  return depths;
}

deep::DeepImage tidied(AnyImage image) {
  auto& found = std::get<deep::DeepImage>(image);
  return deep::isTidy(found) ? std::move(found) : deep::tidy(std::move(found)).image;
}

flat::Image flattened(AnyImage image) {
  if (auto* flat = std::get_if<flat::Image>(&image)) return std::move(*flat);
  return deep::flatten(std::get<deep::DeepImage>(image));
}

// Measures the frames of a run one after the other; what is decided from the first one holds for all.
class Comparison {
 public:
  explicit Comparison(const CompareParams& params) : params_(params) {}

  ordered_json compareFrame(const std::string& path, const std::string& referencePath, const std::string& noisyPath) {
    AnyImage image = loadImage(path, isCompared), reference = loadImage(referencePath, isCompared);
    ordered_json result;
    FlatPair pair;
    try {
      if (image.index() == 0 && reference.index() == 0) {
        addOwnVariance(noisyPath, std::get<deep::DeepImage>(reference));
        result = compareDeep(tidied(std::move(image)), tidied(std::move(reference)), pair);
      } else {
        if (!params_.clips.empty()) fail("--clip: expected two deep images, found a flat one");
        pair = {flattened(std::move(image)), flattened(std::move(reference))};
        result["flattened"] = toJson(flat::compare(pair.image, pair.reference, metricParams()));
      }
      if (before_)
        flicker_.push_back(
            flat::flicker(before_->image, before_->reference, pair.image, pair.reference, metricParams()));
    } catch (const Error& e) {
      fail("{} against {}: {}", path, referencePath, e.what());
    }
    before_ = std::move(pair);
    return result;
  }

  const FlatPair& lastFrame() const { return *before_; }
  // The mean flicker, or nothing for a single frame.
  std::optional<double> flicker() const {
    if (flicker_.empty()) return {};
    double sum = 0;
    for (const double value : flicker_) sum += value;
    return sum / double(flicker_.size());
  }

 private:
  flat::MetricParams metricParams() const { return {.correct = params_.correct}; }

  // Of a deep reference without variances, from the noisy frame where that is named.
  void addOwnVariance(const std::string& noisyPath, deep::DeepImage& reference) const {
    if (noisyPath.empty() || reference.find("variance.R")) return;
    const AnyImage noisy = loadImage(noisyPath, isCompared);
    if (noisy.index() != 0) fail("--noisy: expected a deep image, found the flat {}", noisyPath);
    deep::addOwnVariance(std::get<deep::DeepImage>(noisy), reference);
  }

  ordered_json compareDeep(const deep::DeepImage& image, const deep::DeepImage& reference, FlatPair& pair) {
    if (!clips_) clips_ = clipDepths(params_, reference);
    pair = {deep::visiblePart(image), deep::visiblePart(reference)};
    return toJson(deep::compare(image, reference, {.correct = params_.correct, .clips = *clips_}));
  }

  const CompareParams& params_;
  std::optional<std::vector<float>> clips_;
  std::optional<FlatPair> before_;
  std::vector<double> flicker_;
};

void runCompare(const CompareParams& params) {
  const Sequence sequence = findSequence(params.image, params.frames);
  if (!sequence.missing.empty())
    fail("{}: expected every frame, found none for {}", sequence.pattern.text(), describeFrames(sequence.missing));
  const FilePattern reference = parsePattern(params.reference), heatmap = parsePattern(params.heatmap);
  const FilePattern noisy = parsePattern(params.noisy);
  if (sequence.frames.size() > 1 && !params.heatmap.empty() && !heatmap.numbered())
    fail("--heatmap: expected a numbered name for a sequence, found {}", params.heatmap);
  Comparison comparison(params);
  std::vector<ordered_json> frames;
  ordered_json report = {{"corrected", params.correct}, {"frames", ordered_json::array()}};
  for (const int frame : sequence.frames) {
    const std::string path = sequence.pattern.at(frame), referencePath = reference.at(frame);
    frames.push_back(comparison.compareFrame(path, referencePath, params.noisy.empty() ? "" : noisy.at(frame)));
    report["frames"].push_back({{"image", path}, {"reference", referencePath}});
    report["frames"].back().update(frames.back());
    if (!params.heatmap.empty()) {
      const FlatPair& pair = comparison.lastFrame();
      flat::writePng(heatmap.at(frame),
                     flat::heatmap(flat::relativeError(pair.image, pair.reference), pair.image.dataWindow));
    }
    if (params.asJson) continue;
    fmt::print("{}{} against {}\n", frames.size() > 1 ? "\n" : "", path, referencePath);
    printTable(frames.back());
    printNotes(frames.back(), params.correct);
  }
  report["mean"] = meanOf(frames);
  if (const auto flicker = comparison.flicker()) report["flicker"] = *flicker;
  if (params.asJson) {
    fmt::print("{}\n", report.dump(2));
  } else if (frames.size() > 1) {
    fmt::print("\nMean of {} frames\n", frames.size());
    printTable(report["mean"]);
    fmt::print("Flicker, the relMSE of the change from frame to frame: {:.5f}\n", *comparison.flicker());
  }
}

}  // namespace

void addCompare(CLI::App& app) {
  auto params = std::make_shared<CompareParams>();
  CLI::App* command = app.add_subcommand("compare", "Measure how far an image is from a reference");
  command->add_option("image", params->image, "Deep or flat image, or a sequence: name.####.exr")->required();
  command->add_option("reference", params->reference, "Its reference: flat, or deep with the same bins")->required();
  command->add_option("--frames", params->frames, "Frames of the sequence, such as 1-100x2 (default: those on disk)");
  command->add_flag("--correct", params->correct, "Subtract the reference's own error, from its variance channels");
  command->add_option("--noisy", params->noisy,
                      "The noisy frame: with --correct, its variances and the sample counts of both tell a deep "
                      "reference's own error");
  command
      ->add_option(
          "--clip", params->clips,
          "Depths of clip planes, such as 3.5,7,median: deep images are also measured in front of and behind each")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_flag("--json", params->asJson, "Print everything as JSON");
  command->add_option("--heatmap", params->heatmap, "Write the relative error of each pixel as a PNG, with its scale");
  command->footer(
      "relMSE is the mean of (a-r)^2 / (r^2 + 0.01) over R, G and B; `without worst` leaves out the worst 0.1 % of the "
      "pixels.\n"
      "PSNR and SSIM are of tone-mapped images (x/(1+x), then sRGB). Per bin, colours are not premultiplied and weigh "
      "as much\n"
      "as their bins show; in front and behind, samples count as they show in the whole pixel.");
  command->callback([params] { runCompare(*params); });
}

}  // namespace fathom::cli
