// Operations that move pixels and depths, or choose channels and samples: transform, insert, resize, reformat, shuffle,
// limit.
#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <memory>

#include "base/error.h"
#include "cli/operation.h"
#include "deep/ops/insert.h"
#include "deep/ops/limit.h"
#include "deep/ops/reformat.h"
#include "deep/ops/resize.h"
#include "deep/ops/shuffle.h"
#include "deep/tidy.h"

namespace fathom::cli {

namespace {

Rows rowsNeeded(const deep::Resampling& how, Rows result) {
  const deep::Extent needed = neededBy(how.rows, how.filter, {result.y0, result.y1});
  return {needed.begin, needed.end};
}

// What is lost where samples are mixed, for the user; of the channels alone.
std::vector<std::string> droppedLines(const deep::DeepImage& form) {
  deep::DeepImage copy = form.copy();
  std::string names;
  for (const std::string& name : deep::dropSampleStatistics(copy)) names += " " + name;
  if (names.empty()) return {};
  return {"samples are mixed, so these were dropped:" + names};
}

deep::Transform transformOf(const Arguments& arguments) {
  const deep::Transform how{.x = arguments.number("x"),
                            .y = arguments.number("y"),
                            .scale = arguments.number("scale"),
                            .z = arguments.number("z"),
                            .zScale = arguments.number("zscale"),
                            .tolerance = arguments.number("tolerance")};
  how.check();
  return how;
}

Operation makeTransform(const Arguments& arguments, std::span<const InputForm> inputs) {
  const deep::Transform how = transformOf(arguments);
  const deep::DeepImage& form = deepOf(inputs[0].image);
  const deep::Resampling pixels = how.resampling(form.displayWindow);
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage { return transform(std::move(deepOf(in[0])), how); };
  operation.window = [=](std::span<const Box> windows) { return resampledWindow(windows[0], pixels); };
  operation.needs = [=](size_t, Rows rows) { return rowsNeeded(pixels, rows); };
  if (pixels.mixes()) operation.summary = [lines = droppedLines(form)] { return lines; };
  return operation;
}

Operation makeInsert(const Arguments& arguments, std::span<const InputForm> inputs) {
  const deep::Transform how = transformOf(arguments);
  const deep::Resampling pixels = how.resampling(deepOf(inputs[1].image).displayWindow);
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    return deep::insert(deepOf(in[0]), std::move(deepOf(in[1])), how);
  };
  operation.window = [=](std::span<const Box> windows) {
    return unionOf(windows[0], resampledWindow(windows[1], pixels));
  };
  operation.needs = [=](size_t input, Rows rows) { return input == 0 ? rows : rowsNeeded(pixels, rows); };
  operation.summary = [lines = deep::describeInsert(deepOf(inputs[0].image), deepOf(inputs[1].image), how)] {
    return lines;
  };
  return operation;
}

struct Size {
  int width, height;
};

int scaled(int size, double factor) {
  const double result = std::round(size * factor);
  if (!(result <= 1e6)) fail("resize: expected at most a million pixels on a side, found {}", result);
  return std::max(1, int(result));
}

Size sizeOf(const Arguments& arguments, const Box& display) {
  if (arguments.has("size") == arguments.has("factor"))
    fail("resize: expected either factor or size, found {}", arguments.has("size") ? "both" : "none");
  if (arguments.has("factor")) {
    const double factor = arguments.number("factor");
    if (!(factor > 0)) fail("resize: factor: expected a number above 0, found {}", factor);
    return {scaled(display.width(), factor), scaled(display.height(), factor)};
  }
  const std::vector<double> size = arguments.numbers("size");
  if (size.size() > 2) fail("resize: size: expected width,height or a width alone, found {} numbers", size.size());
  for (const double side : size)
    if (!(side >= 1 && side <= 1e6 && side == std::floor(side)))
      fail("resize: size: expected whole numbers from 1 to a million, found {}", side);
  if (size.size() == 2) return {int(size[0]), int(size[1])};
  return {int(size[0]), scaled(display.height(), size[0] / std::max(1, display.width()))};
}

Operation makeResize(const Arguments& arguments, std::span<const InputForm> inputs) {
  const deep::DeepImage& form = deepOf(inputs[0].image);
  const Size size = sizeOf(arguments, form.displayWindow);
  const deep::Filter filter = arguments.text("filter") == "box" ? deep::Filter::Box : deep::Filter::Bilinear;
  const double tolerance = arguments.number("tolerance");
  const deep::Resampling pixels = deep::resizing(form.displayWindow, size.width, size.height, filter, tolerance);
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    return deep::resize(std::move(deepOf(in[0])), size.width, size.height, filter, tolerance);
  };
  operation.window = [=](std::span<const Box> windows) { return resampledWindow(windows[0], pixels); };
  operation.needs = [=](size_t, Rows rows) { return rowsNeeded(pixels, rows); };
  if (pixels.mixes()) operation.summary = [lines = droppedLines(form)] { return lines; };
  return operation;
}

Operation makeReformat(const Arguments& arguments, std::span<const InputForm> inputs) {
  const Box display = arguments.box("box");
  if (display.empty()) fail("reformat: box: expected a box that is not empty, found {}", arguments.text("box"));
  const std::string& place = arguments.text("place");
  const deep::Placement placement = place == "stay"     ? deep::Placement::Stay
                                    : place == "corner" ? deep::Placement::Corner
                                                        : deep::Placement::Centre;
  const bool crops = arguments.flag("crop");
  const deep::Move move = deep::reformatMove(deepOf(inputs[0].image).displayWindow, display, placement);
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    return deep::reformat(std::move(deepOf(in[0])), display, placement, crops);
  };
  operation.window = [=](std::span<const Box> windows) {
    const Box all = moved(windows[0], move.x, move.y);
    return crops ? intersect(all, display) : all;
  };
  operation.needs = [=](size_t, Rows rows) { return Rows{rows.y0 - move.y, rows.y1 - move.y}; };
  return operation;
}

// "to:from", cut at the first colon.
std::pair<std::string, std::string> pairOf(const std::string& text, const std::string& argument) {
  const size_t colon = text.find(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size())
    fail("shuffle: {}: expected names with a colon between, found {}", argument, text);
  return {text.substr(0, colon), text.substr(colon + 1)};
}

double constantOf(const std::string& text) {
  try {
    size_t used = 0;
    const double value = std::stod(text, &used);
    if (used == text.size() && std::isfinite(value)) return value;
  } catch (const std::exception&) {
  }
  fail("shuffle: set: expected a number, found {}", text);
}

deep::Shuffle shuffleOf(const Arguments& arguments) {
  deep::Shuffle how;
  const auto words = [&](const char* name) {
    return arguments.has(name) ? arguments.words(name) : std::vector<std::string>();
  };
  for (const std::string& word : words("map")) {
    const auto [to, from] = pairOf(word, "map");
    how.map.push_back({to, from});
  }
  how.keep = words("keep");
  how.drop = words("drop");
  for (const std::string& word : words("set")) {
    const auto [name, value] = pairOf(word, "set");
    how.set.push_back({name, constantOf(value)});
  }
  return how;
}

Operation makeShuffle(const Arguments& arguments, std::span<const InputForm> inputs) {
  const deep::Shuffle how = shuffleOf(arguments);
  deep::shuffle(deepOf(inputs[0].image).copy(), how);  // says what is missing before anything is read
  return {.apply = [=](std::vector<AnyImage> in) -> AnyImage { return deep::shuffle(std::move(deepOf(in[0])), how); }};
}

Operation makeLimit(const Arguments& arguments, std::span<const InputForm> inputs) {
  const int most = arguments.whole("samples");
  if (most < 1) fail("limit: samples: expected at least 1, found {}", most);
  const auto before = std::make_shared<std::atomic<uint64_t>>(0), after = std::make_shared<std::atomic<uint64_t>>(0);
  Operation operation;
  operation.apply = [=](std::vector<AnyImage> in) -> AnyImage {
    *before += deepOf(in[0]).samples();
    deep::DeepImage result = deep::limit(std::move(deepOf(in[0])), most);
    *after += result.samples();
    return result;
  };
  operation.summary = [=, lines = droppedLines(deepOf(inputs[0].image))] {
    std::vector<std::string> all{fmt::format("{} samples, {} before", after->load(), before->load())};
    all.insert(all.end(), lines.begin(), lines.end());
    return all;
  };
  return operation;
}

std::vector<ArgumentSpec> transformArguments() {
  using Type = ArgumentType;
  return {{"z", Type::Number, "0", "how much farther away, in units of depth"},
          {"x", Type::Number, "0", "pixels to the right"},
          {"y", Type::Number, "0", "pixels down"},
          {"scale", Type::Number, "1", "larger or smaller, about the middle of the picture"},
          {"zscale", Type::Number, "1", "factor of the depths, before z is added"},
          {"tolerance", Type::Number, "0.001", "where pixels mix: depths that differ by this part become one sample"}};
}

}  // namespace

void addGeometryOperations(std::vector<OperationSpec>& table) {
  using enum ImageKind;
  using Type = ArgumentType;
  table.push_back({"transform",
                   "Move an image by whole or part pixels, scale it, and move and scale its depths.",
                   {Deep},
                   false,
                   transformArguments(),
                   makeTransform});
  table.push_back({"insert",
                   "Place the second image, smoke for example, in the first: moved, scaled, and merged with it.",
                   {Deep, Deep},
                   false,
                   transformArguments(),
                   makeInsert});
  table.push_back({"resize",
                   "The same picture with fewer or more pixels; samples at nearly the same depth become one.",
                   {Deep},
                   false,
                   {{"factor", Type::Number, "", "0.5 for half the width and height"},
                    {"size", Type::Numbers, "", "width,height, or the width alone"},
                    {"filter",
                     Type::Text,
                     "box",
                     "box: the mean of what a pixel covers; bilinear: smooth enlarging",
                     false,
                     {"box", "bilinear"}},
                    {"tolerance", Type::Number, "0.01", "depths that differ by this part become one sample"}},
                   makeResize});
  table.push_back({"reformat",
                   "Another frame around the same pixels.",
                   {Deep},
                   false,
                   {{"box", Type::Box, "", "x,y,width,height of the new frame", true},
                    {"place",
                     Type::Text,
                     "centre",
                     "where the picture goes: to the centre, the upper left corner, or it stays",
                     false,
                     {"centre", "corner", "stay"}},
                    {"crop", Type::Flag, "0", "remove what is outside of the frame"}},
                   makeReformat});
  table.push_back({"shuffle",
                   "Copy, keep, drop and fill channels, in this order. A * in a name stands for any characters.",
                   {Deep},
                   false,
                   {{"map", Type::Text, "", "copies as new:old, such as R:diffuse.R,G:diffuse.G or *:diffuse.*"},
                    {"keep", Type::Text, "", "the only channels that stay, such as R,G,B,A,Z*"},
                    {"drop", Type::Text, "", "channels to remove"},
                    {"set", Type::Text, "", "channels to fill, such as mask:1"}},
                   makeShuffle});
  table.push_back({"limit",
                   "At most so many samples in a pixel: those whose union is seen least become one.",
                   {Deep},
                   false,
                   {{"samples", Type::Whole, "", "the most that a pixel may have", true}},
                   makeLimit});
}

}  // namespace fathom::cli
