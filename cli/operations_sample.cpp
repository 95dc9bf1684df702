// Operations that pass samples on, or decide which of them stay: merge, clip, crop, tidy, flatten.
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <memory>

#include "base/error.h"
#include "cli/operation.h"
#include "cli/row_counts.h"
#include "deep/channels.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/ops/crop.h"
#include "deep/ops/merge.h"
#include "deep/tidy.h"

namespace fathom::cli {

namespace {

Box windowOfAll(std::span<const Box> windows) {
  Box all = windows[0];
  for (const Box& window : windows) all = unionOf(all, window);
  return all;
}

Operation makeMerge(const Arguments& arguments, std::span<const InputForm> inputs) {
  std::vector<deep::DeepImage> forms;
  for (const InputForm& input : inputs) forms.push_back(deepOf(input.image).copy());
  const bool tidies = arguments.flag("tidy");
  Operation operation;
  operation.apply = [tidies](std::vector<AnyImage> images) -> AnyImage {
    std::vector<deep::DeepImage> taken;
    for (AnyImage& image : images) taken.push_back(std::move(deepOf(image)));
    deep::DeepImage merged = deep::merge(taken);
    if (!tidies) return merged;
    deep::dropSampleStatistics(merged);
    return deep::tidy(std::move(merged)).image;
  };
  operation.window = windowOfAll;
  operation.summary = [lines = deep::describeMerge(forms)] { return lines; };
  return operation;
}

Operation makeClip(const Arguments& arguments, std::span<const InputForm> inputs) {
  const float near = float(arguments.number("near")), far = float(arguments.number("far"));
  const auto cuts = std::make_shared<std::atomic<bool>>(false);
  deep::DeepImage form = deepOf(inputs[0].image).copy();
  const bool mayCut = form.find("ZBack") && !deep::dropSampleStatistics(form).empty();
  Operation operation;
  if (mayCut)
    operation.scan = [=](const AnyImage& band) {
      if (deep::clipCuts(deepOf(band), near, far)) *cuts = true;
    };
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    if (*cuts) deep::dropSampleStatistics(deepOf(in[0]));
    return deep::clip(deepOf(in[0]), near, far);
  };
  return operation;
}

Operation makeCrop(const Arguments& arguments, std::span<const InputForm>) {
  const Box box = arguments.box("box");
  const bool outside = arguments.flag("outside");
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage { return deep::crop(deepOf(in[0]), box, outside); };
  operation.window = [=](std::span<const Box> windows) { return outside ? windows[0] : intersect(windows[0], box); };
  return operation;
}

// What tidying found in the whole image and did to it.
struct TidyCount {
  deep::Untidiness untidiness;
  RowCounts before, after;
};

Operation makeTidy(const Arguments&, std::span<const InputForm> inputs) {
  const auto count = std::make_shared<TidyCount>();
  deep::DeepImage form = deepOf(inputs[0].image).copy();
  const bool pointsStay = deep::holdsStatistics(form);
  const std::vector<std::string> statistics = deep::dropSampleStatistics(form);
  Operation operation;
  operation.scan = [=](const AnyImage& band) {
    count->untidiness |= deep::findUntidiness(deepOf(band));
    if (pointsStay) count->untidiness.pointsCoincide = false;
  };
  const auto splits = [count] { return count->untidiness.volumesOverlap; };
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    deep::DeepImage& image = deepOf(in[0]);
    count->before.setSamples(image);
    if (splits()) deep::dropSampleStatistics(image);
    if (count->untidiness.any()) image.attributes.erase("deepImageState");
    deep::DeepImage result = deep::tidy(std::move(image)).image;
    count->after.setSamples(result);
    return result;
  };
  operation.summary = [=] {
    std::vector<std::string> lines{fmt::format("{} samples, {} before{}", count->after.total(), count->before.total(),
                                               count->untidiness.any() ? "" : ", was tidy")};
    if (splits() && !statistics.empty()) lines.push_back("samples were merged or split, so these were dropped:");
    for (const std::string& name : statistics)
      if (splits()) lines.back() += " " + name;
    return lines;
  };
  return operation;
}

// In the order of deep::FlatDepth.
const std::vector<std::string> kDepths = {"mean", "front", "back", "transmittance"};

deep::FlatDepth flatDepth(const std::string& name) {
  const auto found = std::ranges::find(kDepths, name);
  if (found == kDepths.end()) fail("depths: expected {}, found {}", fmt::join(kDepths, ", "), name);
  return deep::FlatDepth(found - kDepths.begin());
}

Operation makeFlatten(const Arguments& arguments, std::span<const InputForm>) {
  deep::FlattenParams params{flatDepth(arguments.text("z")), {}, arguments.number("at")};
  if (arguments.has("depths"))
    for (const std::string& name : arguments.words("depths")) params.depths.push_back(flatDepth(name));
  const auto nonFinite = std::make_shared<std::atomic<uint64_t>>(0);
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    *nonFinite += deep::countNonFinite(deepOf(in[0]));
    return deep::flatten(deepOf(in[0]), params);
  };
  operation.summary = [=]() -> std::vector<std::string> {
    if (*nonFinite == 0) return {};
    return {fmt::format("{} samples with values that are not finite: taken for 0", nonFinite->load())};
  };
  return operation;
}

}  // namespace

void addSampleOperations(std::vector<OperationSpec>& table) {
  using enum ImageKind;
  using Type = ArgumentType;
  table.push_back({"merge",
                   "The samples of all images together, front to back.",
                   {Deep, Deep},
                   true,
                   {{"tidy", Type::Flag, "0", "split volumes where they cross and merge what coincides"}},
                   makeMerge});
  table.push_back({"clip",
                   "What lies between two depths, NEAR included, FAR not; a volume on the plane is cut.",
                   {Deep},
                   false,
                   {{"near", Type::Number, "", "the nearest depth that stays", true},
                    {"far", Type::Number, "", "the first depth that goes; inf for none", true}},
                   makeClip});
  table.push_back({"crop",
                   "The pixels inside of a box, or all others.",
                   {Deep},
                   false,
                   {{"box", Type::Box, "", "x,y,width,height in pixels of the image", true},
                    {"outside", Type::Flag, "0", "keep what is outside of it"}},
                   makeCrop});
  table.push_back(
      {"tidy",
       "Sort samples front to back, split volumes that overlap others, and merge what then lies at the same "
       "depth. The picture stays the same; compositing gets exact and fast.",
       {Deep},
       false,
       {},
       makeTidy});
  table.push_back({"flatten",
                   "Composite the samples into a flat image.",
                   {Deep},
                   false,
                   {{"z", Type::Text, "mean",
                     "the depth in Z: mean (of all that is seen), front, back, or transmittance (where the light that "
                     "passes falls to `at`)",
                     false, kDepths},
                    {"at", Type::Number, "0.5", "how much light passes at the depth `transmittance`: 0 to 1"},
                    {"depths", Type::Text, "", "further channels, like front,back: Z.front and Z.back"}},
                   makeFlatten});
}

}  // namespace fathom::cli
