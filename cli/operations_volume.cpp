// Operations on what stands in front of what, and on volumes: holdout, clip by a map, keymix, plus, deepen, fog.
#include "base/error.h"
#include "cli/operation.h"
#include "deep/clip.h"
#include "deep/ops/deepen.h"
#include "deep/ops/fog.h"
#include "deep/ops/holdout.h"
#include "deep/ops/keymix.h"
#include "deep/ops/plus.h"

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

Operation makePlus(const Arguments&, std::span<const InputForm>) {
  Operation operation;
  operation.apply = [](std::vector<AnyImage> in) -> AnyImage {
    return deep::plus(std::move(deepOf(in[0])), std::move(deepOf(in[1])));
  };
  operation.window = [](std::span<const Box> windows) { return unionOf(windows[0], windows[1]); };
  return operation;
}

Operation makeDeepen(const Arguments& arguments, std::span<const InputForm> inputs) {
  deep::DeepenParams params{.depthChannel = arguments.text("channel"),
                            .thickness = float(arguments.number("thickness")),
                            .extinction = arguments.text("alpha") == "extinction"};
  if (arguments.has("z")) params.z = float(arguments.number("z"));
  deep::deepen(flatOf(inputs[0].image), params);  // throws where they do not do
  return {.apply = [=](std::vector<AnyImage> in) -> AnyImage { return deep::deepen(flatOf(in[0]), params); }};
}

Operation makeKeymix(const Arguments& arguments, std::span<const InputForm> inputs) {
  const flat::Image& matte = flatOf(inputs[2].image);
  if (matte.planes.empty()) fail("keymix: expected a matte with a channel, found none");
  const std::string channel =
      arguments.has("channel") ? arguments.text("channel") : (matte.find("A") ? "A" : matte.planes[0].name);
  matte.get(channel);
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    return deep::keymix(deepOf(in[0]), deepOf(in[1]), flatOf(in[2]), channel);
  };
  operation.window = [](std::span<const Box> windows) { return unionOf(windows[0], windows[1]); };
  return operation;
}

deep::FogParams fogParams(const Arguments& arguments) {
  deep::FogParams params{
      .near = arguments.number("near"), .far = arguments.number("far"), .density = arguments.number("density")};
  const std::vector<double> colour = arguments.numbers("colour");
  if (colour.size() != 3) fail("fog: colour: expected three numbers, found {}", arguments.text("colour"));
  std::copy(colour.begin(), colour.end(), params.colour.begin());
  if (arguments.has("fov")) params.fieldOfView = float(arguments.number("fov"));
  if (!arguments.has("height")) return params;
  const std::string& up = arguments.text("up");
  params.height = deep::FogHeight{.height = arguments.number("height"),
                                  .falloff = arguments.number("falloff"),
                                  .up = up == "x" ? deep::Axis::X : (up == "y" ? deep::Axis::Y : deep::Axis::Z),
                                  .slabs = arguments.whole("slabs")};
  return params;
}

Operation makeFog(const Arguments& arguments, std::span<const InputForm> inputs) {
  const deep::FogParams params = fogParams(arguments);
  const bool applies = arguments.flag("apply");
  const deep::DeepImage& form = deepOf(inputs[0].image);
  deep::fogVolumes(form, params);  // throws where they do not do
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    deep::DeepImage& image = deepOf(in[0]);
    return applies ? deep::applyFog(std::move(image), params) : deep::insertFog(std::move(image), params);
  };
  if (!deep::ViewRays(form.attributes, form.displayWindow, params.fieldOfView, deep::Axis::Y).hasScale())
    operation.summary = []() -> std::vector<std::string> {
      return {"the field of view is not known: fog is as thick at the borders of the frame as in its middle (see fov)"};
    };
  return operation;
}

// What hides something.
bool isOpacity(const std::string& channel) {
  return channel == "A" || channel == "Z" || channel == "ZBack";
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
       makeHoldout,
       false,
       [](size_t input, const std::string& channel) { return input == 0 || isOpacity(channel); }});
  table.push_back({"holdoutmatte",
                   "A flat matte: how much of the first image's alpha is seen past the second, 1 where there is none.",
                   {Deep, Deep},
                   false,
                   {},
                   makeHoldoutMatte,
                   false,
                   [](size_t, const std::string& channel) { return isOpacity(channel); }});
  table.push_back(
      {"clipmap",
       "What lies in front of, or behind, the depths of a flat image; a volume there is cut. Pixels that it "
       "has no depth for stay as they are.",
       {Deep, Flat},
       false,
       {{"keep", Type::Text, "front", "front or behind", false, {"front", "behind"}},
        {"channel", Type::Text, "Z", "the channel of the flat image with the depths"}},
       makeClipMap});
  table.push_back({"keymix",
                   "The first image where a flat matte is 1, the second where it is 0, and their mean between.",
                   {Deep, Deep, Flat},
                   false,
                   {{"channel", Type::Text, "", "the channel of the matte; A or the first, where it is not given"}},
                   makeKeymix});
  table.push_back({"plus",
                   "Add the light of the second image to the first: it hides nothing, and what is in front of it hides "
                   "it.",
                   {Deep, Deep},
                   false,
                   {},
                   makePlus});
  table.push_back({"deepen",
                   "A flat image as a deep one, a sample in every pixel. Pixels without alpha and colour, or without a "
                   "depth, stay empty. An image without alpha is opaque.",
                   {Flat},
                   false,
                   {{"z", Type::Number, "", "one depth for all pixels, instead of the channel's"},
                    {"channel", Type::Text, "Z", "the channel with the depths"},
                    {"thickness", Type::Number, "0", "makes volumes that begin at the depth and are this deep"},
                    {"alpha",
                     Type::Text,
                     "opacity",
                     "opacity: alpha is that of the whole sample; extinction: alpha and colour are amounts per unit of "
                     "thickness",
                     false,
                     {"opacity", "extinction"}}},
                   makeDeepen});
  table.push_back(
      {"fog",
       "Fog between two depths: as volumes among the samples, or applied to them. With a height it lies on "
       "the ground and thins out above.",
       {Deep},
       false,
       {{"density", Type::Number, "", "how much light a unit of length takes away (extinction)", true},
        {"far", Type::Number, "", "the depth where it ends", true},
        {"near", Type::Number, "0", "the depth where it begins"},
        {"colour", Type::Numbers, "0.5,0.5,0.5", "red, green and blue of fog that nothing is seen through"},
        {"height", Type::Number, "", "up to here, in the world, it is dense; needs the camera's attributes"},
        {"falloff", Type::Number, "1", "how far above the height a third of it is left (1/e)"},
        {"up", Type::Text, "y", "the axis of the world that height is along", false, {"x", "y", "z"}},
        {"slabs", Type::Whole, "16", "volumes per pixel for fog with a height"},
        {"fov", Type::Number, "", "horizontal field of view in degrees, where the file does not have it"},
        {"apply", Type::Flag, "0",
         "fade the samples themselves: few samples, but nothing can be put into "
         "this fog any more"}},
       makeFog});
}

}  // namespace fathom::cli
