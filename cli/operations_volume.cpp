// Operations on what stands in front of what, and on volumes: holdout.
#include "cli/operation.h"
#include "deep/clip.h"
#include "deep/ops/holdout.h"
#include "flat/error.h"

namespace fathom::cli {

namespace {

Operation makeHoldout(const Arguments& arguments, std::span<const InputForm>) {
  const double opaque = arguments.number("opaque");
  if (!(opaque > 0 && opaque <= 1)) fail("holdout: opaque: expected a number above 0 and up to 1, found {}", opaque);
  if (arguments.flag("hard"))
    return {.apply = [=](std::vector<AnyImage> in) -> AnyImage {
      return deep::hardHoldout(deepOf(in[0]), deepOf(in[1]), opaque);
    }};
  return {.apply = [](std::vector<AnyImage> in) -> AnyImage {
    return deep::holdout(std::move(deepOf(in[0])), deepOf(in[1]));
  }};
}

Operation makeHoldoutMatte(const Arguments&, std::span<const InputForm>) {
  return {
      .apply = [](std::vector<AnyImage> in) -> AnyImage { return deep::holdoutMatte(deepOf(in[0]), deepOf(in[1])); }};
}

Operation makeClipMap(const Arguments& arguments, std::span<const InputForm> inputs) {
  const std::string channel = arguments.text("channel");
  const deep::Side side = arguments.text("keep") == "front" ? deep::Side::Front : deep::Side::Behind;
  flatOf(inputs[1].image).get(channel);
  return {.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    return deep::clipByMap(deepOf(in[0]), flatOf(in[1]), channel, side);
  }};
}

}  // namespace

void addVolumeOperations(std::vector<OperationSpec>& table) {
  using enum ImageKind;
  using Type = ArgumentType;
  table.push_back(
      {"holdout",
       "What is seen of the first image behind and within the second, volumes included. The two held out by "
       "each other add up to their merge.",
       {Deep, Deep},
       false,
       {{"hard", Type::Flag, "0", "keep or remove whole samples, instead of fading them"},
        {"opaque", Type::Number, "0.5",
         "with hard: the alpha in front at which a sample goes; 1: only "
         "behind what is opaque"}},
       makeHoldout});
  table.push_back({"holdoutmatte",
                   "A flat matte: how much of the first image's alpha is seen past the second, 1 where there is none.",
                   {Deep, Deep},
                   false,
                   {},
                   makeHoldoutMatte});
  table.push_back(
      {"clipmap",
       "What lies in front of, or behind, the depths of a flat image; a volume there is cut. Pixels that it "
       "has no depth for stay as they are.",
       {Deep, Flat},
       false,
       {{"keep", Type::Text, "front", "front or behind", false, {"front", "behind"}},
        {"channel", Type::Text, "Z", "the channel of the flat image with the depths"}},
       makeClipMap});
}

}  // namespace fathom::cli
