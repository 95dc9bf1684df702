// The joint filter, which is most of the denoiser's time, on each instruction set of this machine, against its slow
// twin.
#include <fmt/format.h>
#include <hwy/detect_targets.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include "base/error.h"
#include "tests/bench/measure.h"
#include "tests/reference/filter_frame.h"
#include "tests/reference/joint_filter.h"

namespace fathom::bench {
namespace {

constexpr reference::FrameShape kShape = {.width = 96, .height = 64, .mostBins = 3};
constexpr int kRepeats = 5;

std::vector<int64_t> simdTargets() {
  std::vector<int64_t> targets;
  for (int64_t left = hwy::SupportedTargets() & HWY_TARGETS; left; left &= left - 1) targets.push_back(left & -left);
  return targets;
}

void choose(int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().DeInit();  // the next call of a kernel chooses anew
}

Table kernels() {
  const tbb::global_control oneThread(tbb::global_control::max_allowed_parallelism, 1);
  const deep::JointFilterParams params;
  const reference::RandomFrame frame(kShape, params, 1);
  const std::vector<int64_t> targets = simdTargets();
  std::vector<std::function<void()>> cases = {[&] { reference::jointFilter(frame.input(), params); }};
  std::vector<std::string> names = {"twin, double precision"};
  for (const int64_t target : targets) {
    names.emplace_back(hwy::TargetName(target));
    cases.emplace_back([&, target] {
      choose(target);
      deep::jointFilter(
          frame.input(), params, [](const Box&) { return 3u; }, [](const deep::FilterTile&) {});
    });
  }
  const std::vector<double> seconds = interleavedMedians(cases, kRepeats);
  choose(0);

  const size_t pixels = size_t(kShape.width) * size_t(kShape.height);
  Table table(fmt::format("Joint filter, {}x{} pixels, {:.2f} bins per pixel, one thread", kShape.width, kShape.height,
                          double(frame.input().offsets[pixels]) / double(pixels)),
              {"kernel", "s/MP", "times as fast as the twin"});
  for (size_t i = 0; i < names.size(); ++i)
    table.add({names[i], seconds[i] * 1e6 / double(pixels), seconds[0] / seconds[i]});
  return table;
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  try {
    if (argc != 3) fathom::fail("usage: bench_kernel FOLDER_OF_FRAMES OUTPUT_FOLDER");
    const fathom::bench::Table table = fathom::bench::kernels();
    table.print();
    fathom::bench::writeJson(std::string(argv[2]) + "/kernel.json", {table});
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_kernel: {}\n", e.what());
    return 1;
  }
}
