#include "cli/calibration.h"

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "cli/stopwatch.h"
#include "deep/denoise.h"

namespace fathom::cli {

namespace {

constexpr int kWidth = 256, kHeight = 128, kSpp = 32, kRuns = 3;
constexpr float kSamples = kSpp / 2.0f;  // of each bin

// Two surfaces behind one another in every pixel, with grain in all that the channel convention knows.
deep::DeepImage calibrationFrame() {
  const Box window{0, 0, kWidth, kHeight};
  deep::DeepImage image{window, window, Buffer<uint64_t>(window.area() + 1), {}, {}};
  for (size_t p = 0; p <= window.area(); ++p) image.offsets[p] = 2 * p;
  std::mt19937 random(1);
  const auto fill = [&](const std::string& name, float front, float behind, float grain) {
    std::span<float> values = image.add(name, deep::PixelType::Float).values;
    for (size_t i = 0; i < values.size(); ++i)
      values[i] = (i % 2 ? behind : front) * (1 + grain * (float(random() % 1024) / 512 - 1));
  };
  fill("A", 0.5f, 1, 0);
  fill("Z", 2, 5, 0);
  fill("samples", kSamples, kSamples, 0);
  for (const std::string half : {"half0.", "half1."}) fill(half + "samples", kSamples / 2, kSamples / 2, 0);
  for (const char* c : {"R", "G", "B"}) {
    for (const std::string prefix : {"", "half0.", "half1."}) {
      for (const std::string layer : {"", "diffuse.", "specular."}) fill(prefix + layer + c, 0.2f, 0.4f, 0.5f);
      fill(prefix + "albedo." + c, 0.3f, 0.6f, 0.1f);
    }
    fill(std::string("variance.") + c, 0.01f, 0.01f, 0.5f);
    fill(std::string("variance.albedo.") + c, 1e-3f, 1e-3f, 0.5f);
  }
  for (const char* c : {"X", "Y", "Z"}) {
    fill(std::string("N.") + c, 0.25f, 0.5f, 0.1f);
    fill(std::string("variance.N.") + c, 1e-3f, 1e-3f, 0.5f);
  }
  fill("variance.Z", 1e-4f, 1e-4f, 0.5f);
  image.attributes.set("fathom:spp", kSpp);
  return image;
}

}  // namespace

double calibrationSeconds() {
  const deep::DeepImage frame = calibrationFrame();
  std::vector<std::string> names;
  for (const deep::Channel& channel : frame.channels) names.push_back(channel.name);
  const deep::DenoisePlan plan{deep::findDenoiseInputs(names, frame.attributes), {}, deep::meanLevel(frame)};
  std::vector<double> seconds;
  for (int run = 0; run < kRuns; ++run) {
    deep::DeepImage copy = frame.copy();
    const Stopwatch watch;
    deep::denoise(std::move(copy), plan);
    seconds.push_back(watch.seconds());
  }
  return *std::ranges::min_element(seconds);
}

}  // namespace fathom::cli
