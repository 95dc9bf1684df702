// Whether what was fast still is: the vector kernels on each instruction set of this machine against their slow twins, and
// whole denoisers against Open Image Denoise where it is installed.
//
// Machines differ, so ratios are compared with those that the repository has (FATHOM_RATIOS), and only with such of the same
// instruction set. `record` writes the ratios of this machine there. Both of a ratio run in turn, on one thread; their
// seconds are the processor's.
#include <fmt/format.h>
#include <hwy/detect_targets.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "cli/model_files.h"
#include "deep/denoise.h"
#include "deep/flat_noisy.h"
#include "deep/io.h"
#include "flat/curve_table.h"
#include "flat/neural.h"
#include "flat/oidn.h"
#include "tests/bench/frames.h"
#include "tests/bench/measure.h"
#include "tests/reference/bilateral.h"
#include "tests/reference/filter_frame.h"
#include "tests/reference/flat_gate.h"
#include "tests/reference/joint_filter.h"
#include "tests/reference/kernel_planes.h"
#include "tests/reference/mix.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::bench {
namespace {

constexpr int kRepeats = 5;
constexpr double kBehind = 0.8;    // of the recorded ratio
constexpr double kAtLeast = 0.02;  // seconds of a measurement

// A vector kernel and its twin on the same values; what they work on belongs to them.
struct Kernel {
  std::string name;
  std::function<void()> fast, twin;
};

Kernel jointFilter() {
  const deep::JointFilterParams params;
  const auto frame = std::make_shared<reference::RandomFrame>(
      reference::FrameShape{.width = 64, .height = 32, .mostBins = 3}, params, 1);
  return {"joint filter",
          [=] {
            deep::jointFilter(
                frame->input(), params, [](const Box&) { return 3u; }, [](const deep::FilterTile&) {});
          },
          [=] { reference::jointFilter(frame->input(), params); }};
}

Kernel bilateral() {
  constexpr int kWidth = 96, kHeight = 48;
  const flat::BilateralParams params;
  struct Values {
    std::vector<flat::Padded> guide = reference::randomPadded(3, kWidth, kHeight, flat::BilateralParams().radius, 1),
                              in = reference::randomPadded(3, kWidth, kHeight, flat::BilateralParams().radius, 2), out;
    Buffer<uint8_t> wanted{size_t(kWidth) * size_t(kHeight), 1};
  };
  const auto v = std::make_shared<Values>();
  for (int i = 0; i < 3; ++i) v->out.emplace_back(kWidth, kHeight, 0);
  return {"bilateral", [=] { flat::bilateral(kWidth, kHeight, params, v->wanted, v->guide, v->in, v->out); },
          [=] {
            for (int y = 0; y < kHeight; ++y)
              for (int x = 0; x < kWidth; ++x) reference::bilateral(x, y, params, v->guide, v->in);
          }};
}

Kernel gate() {
  struct Values {
    reference::NoisyFlat frame = reference::makeNoisyFlat(64, 48, 1, 0.05f);
    flat::Noise noise = flat::noiseOf(frame.noisy);
  };
  const auto v = std::make_shared<Values>();
  return {"gate", [=] { flat::gate(v->frame.noisy, v->noise, v->frame.truth, {2}); },
          [=] {
            for (int y = 0; y < 48; ++y)
              for (int x = 0; x < 64; ++x) reference::gate(v->frame.noisy, v->noise, v->frame.truth, x, y, 2);
          }};
}

Kernel mix() {
  constexpr size_t kCount = 49;
  constexpr int kTimes = 4000;
  struct Values {
    flat::MixNeighbours neighbours;
    std::mt19937 random{3};
    std::vector<reference::MixNeighbour> all = reference::randomNeighbours(kCount, 0.1f, random);
    float sum = 0;
  };
  const auto v = std::make_shared<Values>();
  for (const auto& [sample, reach] : v->all) v->neighbours.add(sample, reach);
  return {"mix",
          [=] {
            for (int i = 0; i < kTimes; ++i) v->sum += flat::mixShare(v->all[20].sample, v->neighbours, {}, 1e-4f);
          },
          [=] {
            for (int i = 0; i < kTimes; ++i) v->sum += float(reference::mixShare(v->all[20].sample, v->all, {}, 1e-4));
          }};
}

Kernel curves() {
  constexpr size_t kPixels = 200000;
  constexpr float kHalf = 0.5f;  // rounds
  struct Values {
    flat::CurveTable table = *flat::CurveTable::make(
        [](std::span<float> x) {
          for (float& v : x) v = std::sqrt(std::clamp(v, 0.0f, 1.0f) + 0.01f);
        },
        1e-3f);
    std::vector<float> rgb = std::vector<float>(3 * kPixels);
    std::vector<uint32_t> out = std::vector<uint32_t>(kPixels);
  };
  const auto v = std::make_shared<Values>();
  for (size_t i = 0; i < v->rgb.size(); ++i) v->rgb[i] = float(i % 1013) / 900;
  return {"curves",
          [=] {
            const float* rgb = v->rgb.data();
            flat::lookUpPixels({&v->table, &v->table, &v->table}, {rgb, rgb + kPixels, rgb + 2 * kPixels}, kPixels,
                               v->out.data());
          },
          [=] {
            for (size_t i = 0; i < kPixels; ++i) {
              uint32_t pixel = 0xff;
              for (size_t c = 0; c < 3; ++c)
                pixel = pixel << 8 | uint32_t(255 * v->table(v->rgb[c * kPixels + i]) + kHalf);
              v->out[i] = pixel;
            }
          }};
}

Kernel splat() {
  struct Values {
    reference::Volume logits = reference::randomVolume(28, 64, 96, 1, -3, 3),
                      values = reference::randomVolume(6, 64, 96, 2, 0, 2);
    Buffer<float> grouped = reference::grouped(logits, 16, 2, 0);
    nn::WidePlanes wide = reference::wide(values), result, shares;
  };
  const auto v = std::make_shared<Values>();
  return {"splat", [=] { nn::splat(v->grouped.data(), 16, v->wide, false, v->result, &v->shares); },
          [=] { reference::splatted(v->logits, v->values); }};
}

Kernel filterColour() {
  struct Values {
    reference::Volume logits = reference::randomVolume(26, 64, 96, 1, -3, 3),
                      colour = reference::randomVolume(3, 64, 96, 2, 0, 2);
    Buffer<float> grouped = reference::grouped(logits, 16, 2, 0);
    nn::BorderedColour bordered = reference::bordered(colour);
    std::vector<float> out = std::vector<float>(colour.values.size()), alpha = std::vector<float>(64 * 96);
  };
  const auto v = std::make_shared<Values>();
  return {"kernel filter",
          [=] {
            nn::filterColour(v->grouped.data(), 16, v->bordered, nn::denseRows(v->out.data(), 3, 64, 96),
                             v->alpha.data());
          },
          [=] { reference::filterColour(v->logits, v->colour); }};
}

std::vector<int64_t> simdTargets() {
  std::vector<int64_t> targets;
  for (int64_t left = hwy::SupportedTargets() & HWY_TARGETS; left; left &= left - 1) targets.push_back(left & -left);
  return targets;
}

void choose(int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().DeInit();  // the next call of a kernel chooses anew
}

struct Ratio {
  std::string name, target;
  double value;
};

// Runs of a kernel, as many as take a while, and how many these are.
std::pair<std::function<void()>, double> often(const std::function<void()>& once) {
  const double seconds = interleavedMedians({once}, 3, Clock::cpu).front();
  const int times = int(std::clamp(std::ceil(kAtLeast / std::max(seconds, 1e-6)), 1.0, 1e4));
  return {[=] {
            for (int i = 0; i < times; ++i) once();
          },
          double(times)};
}

std::vector<Ratio> kernelRatios() {
  const tbb::global_control oneThread(tbb::global_control::max_allowed_parallelism, 1);
  const std::vector<int64_t> targets = simdTargets();
  std::vector<Ratio> result;
  for (const Kernel& kernel : {jointFilter(), bilateral(), gate(), mix(), curves(), splat(), filterColour()}) {
    std::vector<std::function<void()>> cases;
    std::vector<double> times;
    const auto add = [&](const std::function<void()>& once) {
      const auto [run, count] = often(once);
      cases.push_back(run);
      times.push_back(count);
    };
    add(kernel.twin);
    for (const int64_t target : targets)
      add([&kernel, target] {
        choose(target);
        kernel.fast();
      });
    const std::vector<double> seconds = interleavedMedians(cases, kRepeats, Clock::cpu);
    for (size_t i = 1; i < cases.size(); ++i)
      result.push_back({kernel.name, hwy::TargetName(targets[i - 1]), seconds[0] / times[0] / (seconds[i] / times[i])});
  }
  choose(0);
  return result;
}

// Open Image Denoise's seconds over ours, on the same frame.
std::vector<Ratio> wholeRatios(const std::string& folder, const flat::Denoiser& other) {
  const tbb::global_control oneThread(tbb::global_control::max_allowed_parallelism, 1);
  const deep::DeepImage bins = tiled(deep::read(folder + "/sequence.0001.deep.exr"), 384, 256);
  std::vector<std::string> names;
  for (const deep::Channel& channel : bins.channels) names.push_back(channel.name);
  const deep::DenoisePlan plan{findDenoiseInputs(names, bins.attributes), {}, meanLevel(bins)};
  const flat::Image pixels = flattenNoisy(bins, plan.inputs);
  const auto net = cli::loadModel("small").net;
  const std::vector<double> seconds =
      interleavedMedians({[&] { other(pixels, {}); }, [&] { deep::denoise(bins.copy(), plan); },
                          [&] { flat::denoiseNeural(*net, {.components = 1}, pixels); }},
                         kRepeats, Clock::cpu);
  const std::string target = hwy::TargetName(simdTargets().front());
  return {{"bins, balanced, over Open Image Denoise", target, seconds[0] / seconds[1]},
          {"network small, K = 1, over Open Image Denoise", target, seconds[0] / seconds[2]}};
}

using Recorded = std::map<std::string, std::map<std::string, double>>;  // ratio by name and instruction set

Recorded readRecorded() {
  std::ifstream file(FATHOM_RATIOS);
  return file ? nlohmann::json::parse(file).get<Recorded>() : Recorded();
}

// Whether nothing fell behind.
bool report(const std::vector<Ratio>& ratios, const Recorded& recorded, const std::string& output) {
  Table table("Times as fast as the twin", {"what", "instructions", "now", "recorded", "now / recorded", ""});
  bool kept = true;
  for (const auto& [name, target, value] : ratios) {
    const auto of = recorded.find(name);
    if (of == recorded.end() || !of->second.contains(target)) {
      table.add({name, target, value, "-", "-", "not recorded"});
      continue;
    }
    const double before = of->second.at(target);
    const bool behind = value < kBehind * before;
    table.add({name, target, value, before, value / before, behind ? "FELL BEHIND" : ""});
    kept = kept && !behind;
  }
  table.print();
  writeJson(output + "/check.json", {table});
  return kept;
}

bool run(const std::string& folder, const std::string& output, bool record) {
  std::vector<Ratio> ratios = kernelRatios();
  try {
    const std::vector<Ratio> whole = wholeRatios(folder, flat::oidn(flat::loadOidn(), {}));
    ratios.insert(ratios.end(), whole.begin(), whole.end());
  } catch (const Error& e) {
    fmt::print("Without Open Image Denoise: {}\n", e.what());
  }
  Recorded recorded = readRecorded();
  if (!record) return report(ratios, recorded, output);
  for (const auto& [name, target, value] : ratios) recorded[name][target] = std::round(value * 100) / 100;
  writeText(FATHOM_RATIOS, nlohmann::json(recorded).dump(1) + "\n");
  return report(ratios, recorded, output);
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  try {
    const bool record = argc == 4 && argv[3] == std::string("record");
    if (argc != 3 && !record) fathom::fail("usage: bench_check FOLDER_OF_FRAMES OUTPUT_FOLDER [record]");
    return fathom::bench::run(argv[1], argv[2], record) ? 0 : 1;
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_check: {}\n", e.what());
    return 1;
  }
}
