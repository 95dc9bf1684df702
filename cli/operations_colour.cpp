// Operations that change values, and how many samples carry them: grade, recolour, expression, compress.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>

#include "base/error.h"
#include "cli/operation.h"
#include "cli/row_counts.h"
#include "deep/ops/compress.h"
#include "deep/ops/expression.h"
#include "deep/ops/grade.h"
#include "deep/ops/named_channels.h"
#include "deep/ops/recolour.h"

namespace fathom::cli {

namespace {

std::string joined(std::string line, std::span<const std::string> names) {
  for (const std::string& name : names) line.append(1, ' ').append(name);
  return line;
}

// Names of `before` that `after` lacks, as a line for the user; none where nothing is missing.
std::vector<std::string> describeDropped(const deep::DeepImage& before, const deep::DeepImage& after) {
  std::vector<std::string> names;
  for (const deep::Channel& channel : before.channels)
    if (!after.find(channel.name)) names.push_back(channel.name);
  if (names.empty()) return {};
  return {joined("dropped, since they no longer describe the image:", names)};
}

std::vector<std::string> describeNew(const deep::DeepImage& before, const deep::DeepImage& after) {
  std::vector<std::string> names;
  for (const deep::Channel& channel : after.channels)
    if (!before.find(channel.name)) names.push_back(channel.name);
  if (names.empty()) return {};
  return {joined("new channels:", names)};
}

// One number for all of R, G and B, or three.
std::array<float, 3> perComponent(const Arguments& arguments, const std::string& name) {
  const std::vector<double> numbers = arguments.numbers(name);
  if (numbers.size() == 1) return {float(numbers[0]), float(numbers[0]), float(numbers[0])};
  if (numbers.size() != 3) fail("{}: expected one number or three, found {}", name, numbers.size());
  return {float(numbers[0]), float(numbers[1]), float(numbers[2])};
}

bool isComponent(const std::string& channel) {
  return channel.starts_with("diffuse.") || channel.starts_with("specular.");
}

Operation makeGrade(const Arguments& arguments, std::span<const InputForm> inputs) {
  deep::GradeParams params;
  params.channels = arguments.words("channels");
  params.gain = perComponent(arguments, "gain");
  params.offset = perComponent(arguments, "offset");
  params.gamma = perComponent(arguments, "gamma");
  params.saturation = float(arguments.number("saturation"));
  params.near = float(arguments.number("near"));
  params.far = float(arguments.number("far"));
  params.nearWidth = float(arguments.number("nearsoft"));
  params.farWidth = float(arguments.number("farsoft"));
  const deep::DeepImage& form = deepOf(inputs[0].image);
  const deep::DeepImage graded = deep::grade(form.copy(), params);
  std::vector<std::string> lines = describeDropped(form, graded);
  const auto changed = deep::channelsNamed(params.channels, deep::floatChannels(form));
  const bool components = std::ranges::any_of(deep::floatChannels(form), isComponent);
  if (components && std::ranges::any_of(changed, isComponent) != (std::ranges::find(changed, "R") != changed.end()))
    lines.emplace_back("R G B and its components (diffuse, specular) were not graded alike: their sum is another now");
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage { return deep::grade(std::move(deepOf(in[0])), params); };
  operation.summary = [=] { return lines; };
  return operation;
}

Operation makeRecolour(const Arguments& arguments, std::span<const InputForm> inputs) {
  const deep::RecolourParams params{.channels = arguments.words("channels"), .matte = arguments.flag("matte")};
  const deep::DeepImage& form = deepOf(inputs[0].image);
  const auto lines = describeDropped(form, deep::recolour(form.copy(), flatOf(inputs[1].image), params));
  const auto uncovered = std::make_shared<RowCounts>();
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    const auto found = deep::countUncovered(deepOf(in[0]), flatOf(in[1]), params);
    uncovered->set<size_t>(deepOf(in[0]).dataWindow.y0, found);
    return deep::recolour(std::move(deepOf(in[0])), flatOf(in[1]), params);
  };
  operation.summary = [=] {
    std::vector<std::string> all = lines;
    if (uncovered->total() > 0)
      all.push_back(
          fmt::format("{} pixels of the flat image have no deep sample: their colour is lost", uncovered->total()));
    return all;
  };
  return operation;
}

Operation makeExpression(const Arguments& arguments, std::span<const InputForm> inputs) {
  const deep::ExpressionParams params{.set = arguments.text("set"),
                                      .unpremultiplied = arguments.flag("unpremultiplied")};
  const deep::DeepImage& form = deepOf(inputs[0].image);
  const deep::DeepImage result = deep::expression(form.copy(), params);
  std::vector<std::string> lines = describeDropped(form, result);
  std::ranges::copy(describeNew(form, result), std::back_inserter(lines));
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    return deep::expression(std::move(deepOf(in[0])), params);
  };
  operation.summary = [=] { return lines; };
  return operation;
}

Operation makeCompress(const Arguments& arguments, std::span<const InputForm> inputs) {
  struct Count {
    RowCounts before, after;
  };
  const deep::CompressParams params{.error = arguments.number("error")};
  const auto count = std::make_shared<Count>();
  const deep::DeepImage& form = deepOf(inputs[0].image);
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    count->before.setSamples(deepOf(in[0]));
    deep::DeepImage result = deep::compress(std::move(deepOf(in[0])), params);
    count->after.setSamples(result);
    return result;
  };
  operation.summary = [=, lines = describeDropped(form, deep::compress(form.copy(), params))] {
    const uint64_t before = count->before.total(), after = count->after.total();
    const double share = before > 0 ? 100 * double(after) / double(before) : 100;
    std::vector<std::string> all{fmt::format("{} samples of {} ({:.1f} %)", after, before, share)};
    std::ranges::copy(lines, std::back_inserter(all));
    return all;
  };
  return operation;
}

}  // namespace

void addColourOperations(std::vector<OperationSpec>& table) {
  using enum ImageKind;
  using Type = ArgumentType;
  table.push_back(
      {"grade",
       "Change colours, everywhere or between two depths: gain, then offset, gamma and saturation. Give one "
       "number, or three for R,G,B.",
       {Deep},
       false,
       {{"gain", Type::Numbers, "1", "multiplies"},
        {"offset", Type::Numbers, "0", "is added"},
        {"gamma", Type::Numbers, "1", "above 1 brightens the middle; above 0"},
        {"saturation", Type::Number, "1", "0 is grey, 1 as it is"},
        {"near", Type::Number, "-inf", "the nearest depth that changes"},
        {"far", Type::Number, "inf", "the first depth that stays again"},
        {"nearsoft", Type::Number, "0", "the depth before near over which it comes in"},
        {"farsoft", Type::Number, "0", "the depth behind far over which it goes out"},
        {"channels", Type::Text, "R,G,B", "channels or layers, such as diffuse"}},
       makeGrade});
  table.push_back({"recolour",
                   "Give the deep samples the colour of a flat image, which may have been graded or painted on: "
                   "flattened, they make it up again. With matte, their alphas make up its alpha, too.",
                   {Deep, Flat},
                   false,
                   {{"matte", Type::Flag, "0", "take the alpha of the flat image, too"},
                    {"channels", Type::Text, "R,G,B", "channels or layers of the flat image"}},
                   makeRecolour});
  table.push_back(
      {"expression",
       "Set channels from formulas, for instance set=\"R = R*0.5; A = clamp(A, 0, 1)\". Names are channels, x "
       "and y of the pixel, i, the number of the sample in its pixel, and n, how many there are. Functions "
       "are abs min max clamp lerp smoothstep floor ceil mod sqrt exp ln sin cos and more; choices are "
       "written Z < 5 ? R : 0.",
       {Deep},
       false,
       {{"set", Type::Text, "", "CHANNEL = FORMULA, any number with ; between them", true},
        {"unpremultiplied", Type::Flag, "0", "work on colours divided by alpha"}},
       makeExpression});
  table.push_back(
      {"compress",
       "As few samples as look the same: what passes to any depth, and the colour in front of it, stay within "
       "the error. What is hidden behind something opaque goes.",
       {Deep},
       false,
       {{"error", Type::Number, "0.001", "the most that may change, where 1 is all of a pixel's light"}},
       makeCompress});
}

}  // namespace fathom::cli
