// What a plane that is dragged through a deep frame costs: the view that is drawn again, and the histogram beside it.
#include "deep/clip_view.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include "deep/clip.h"
#include "deep/depth_histogram.h"
#include "deep/flatten.h"
#include "gui/compositor.h"
#include "tests/bench/measure.h"
#include "tests/bench/thicket.h"

namespace fathom::bench {
namespace {

constexpr int kWidth = 1920, kHeight = 1080, kRepeats = 9;

// What the viewer is to be done within, from compositing to coloured pixels, on two cores.
constexpr double kHalfBar = 33, kFullBar = 150;  // ms

Table measureCompositing(const deep::DeepImage& image) {
  const float infinity = std::numeric_limits<float>::infinity();
  struct Case {
    std::string name;
    deep::DepthRange range;
  };
  const std::vector<Case> cases = {
      {"all", {}},
      {"from 3.01", {3.01f, infinity}},
      {"3.01 to 3.51", {3.01f, 3.51f}},
      {"3.01 to 3.51, soft", {3.01f, 3.51f, 0.1f}},
      {"3.01 to 3.51, inverted", {3.01f, 3.51f, 0, true}},
  };
  std::vector<std::function<void()>> runs;
  for (const Case& one : cases)
    for (const int step : {2, 1})
      runs.emplace_back([&image, &one, step] {
        deep::clipView(image, image.dataWindow, step, one.range, {"R", "G", "B", "A"});
      });
  runs.emplace_back([&] { deep::flatten(deep::clip(image, 3.01f, 3.51f)); });
  runs.emplace_back([&] { deep::depthHistogram(image, deep::axisOf(image, true), 512, deep::DepthWeight::Seen); });
  const std::vector<double> seconds = interleavedMedians(runs, kRepeats);
  Table table(fmt::format("Clipped views, {} x {}, {} samples of R G B A Z ZBack, {} threads", kWidth, kHeight,
                          image.samples(), tbb::this_task_arena::max_concurrency()),
              {"range", "half resolution ms", "full ms"});
  for (size_t i = 0; i < cases.size(); ++i)
    table.add({cases[i].name, 1000 * seconds[2 * i], 1000 * seconds[2 * i + 1]});
  table.add({"3.01 to 3.51, by clip and flatten", "-", 1000 * seconds[seconds.size() - 2]});
  table.add({"histogram of all depths, logarithmic, alpha", "-", 1000 * seconds.back()});
  return table;
}

// A plane that moves on with every picture, as it is dragged.
Table measureDragging(const gui::PicturePtr& picture) {
  struct Case {
    std::string name;
    deep::DepthRange range;
    std::string layer = "RGBA";
  };
  const float infinity = std::numeric_limits<float>::infinity();
  const std::vector<Case> cases = {
      {"near plane, colours", {3, infinity}},
      {"both planes, colours", {3, 3.5f}},
      {"both planes, soft, colours", {3, 3.5f, 0.1f}},
      {"both planes, inverted, colours", {3, 3.5f, 0, true}},
      {"near plane, depth", {3, infinity}, "Z"},
      {"near plane, samples per pixel", {3, infinity}, "samples per pixel"},
  };
  gui::Compositor compositor(std::make_shared<gui::Display>());
  gui::RenderRequest request{picture, nullptr, {}, picture->dataWindow()};
  float moved = 0;
  std::vector<std::function<void()>> runs;
  for (const Case& one : cases)
    for (const int step : {2, 1})
      runs.emplace_back([&, step] {
        request.state.layer = one.layer;
        request.state.clip = one.range;
        request.state.clip.near += (moved += 1e-5f);
        compositor.make(request, step);
      });
  gui::Compositor colouring(std::make_shared<gui::Display>());  // keeps its planes
  gui::RenderRequest brighter = request;
  for (const int step : {2, 1})
    runs.emplace_back([&, step] {
      brighter.state.display.exposure = (moved += 1e-5f);
      colouring.make(brighter, step);
    });
  const std::vector<double> seconds = interleavedMedians(runs, kRepeats);
  Table table(fmt::format("A plane dragged in fathom-view, composited and coloured, {} x {}, {} threads", kWidth,
                          kHeight, tbb::this_task_arena::max_concurrency()),
              {"what is dragged", "half resolution ms", "bar ms", "full ms", "full bar ms"});
  const auto add = [&](const std::string& name, size_t i) {
    table.add({name, 1000 * seconds[2 * i], kHalfBar, 1000 * seconds[2 * i + 1], kFullBar});
  };
  for (size_t i = 0; i < cases.size(); ++i) add(cases[i].name, i);
  add("exposure: colouring alone", cases.size());
  return table;
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  if (argc != 3) return fmt::print(stderr, "usage: bench_clip_view DEMO_FOLDER OUTPUT_FOLDER\n"), 2;
  using namespace fathom::bench;
  const fathom::gui::PicturePtr picture = fathom::gui::makePicture("thicket", thicket(kWidth, kHeight, 1));
  const std::vector<Table> tables = {measureCompositing(*picture->deep()), measureDragging(picture)};
  for (const Table& table : tables) table.print();
  writeJson(std::string(argv[2]) + "/clip_view.json", tables);
}
