#include "deep/base_guide.h"

#include <algorithm>

#include "deep/filter_passes.h"
#include "deep/still.h"
#include "flat/gate.h"
#include "flat/neighbourhood.h"

namespace fathom::deep {

namespace {

constexpr double kWorthARun = 0.02;
// How far around a pixel a denoiser's results matter to it: by the windows of its own gate, of the one here, and of the mixes.
constexpr int kGuideReach = 3 * flat::kNeighbourRadius;

template <class T>
void append(Buffer<T>& above, const Buffer<T>& below) {
  Buffer<T> both(above.size() + below.size());
  std::ranges::copy(below, std::ranges::copy(above, both.begin()).out);
  above = std::move(both);
}

void appendRows(flat::Image& above, const flat::Image& below) {
  for (flat::Plane& plane : above.planes) append(plane.values, below.get(plane.name).values);
  above.dataWindow.y1 = below.dataWindow.y1;
}

// 0 where what a guide says is never seen: the deep filter keeps the colours of all that is near.
Buffer<uint8_t> askedPixels(const GuideInput& input, const DenoisePlan& plan) {
  const Box& window = input.noisy.dataWindow;
  if (input.calm.empty()) return Buffer<uint8_t>(window.area(), 1);
  const int radius = filterPasses(plan).back().radius() + kGuideReach;
  Buffer<uint8_t> asked = allWithin(input.calm, window.width(), window.height(), radius);
  for (uint8_t& pixel : asked) pixel = !pixel;
  return asked;
}

// Asks a picture of what is asked for, and of nothing else than before.
void ask(flat::Image& picture, const Buffer<uint8_t>& asked) {
  flat::Plane* plane = picture.find(flat::kAsked);
  Buffer<float>& values = plane ? plane->values : picture.add(flat::kAsked, 1).values;
  for (size_t i = 0; i < asked.size(); ++i)
    if (!asked[i]) values[i] = 0;
}

flat::Image renderOf(const flat::Image& noisy) {
  flat::Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  for (const char* name : flat::kRgbNames) result.planes.push_back({name, noisy.get(name).values.copy()});
  return result;
}

flat::Image denoised(const flat::Denoiser& denoiser, const flat::Image& noisy, const Progress& progress) {
  const Buffer<float>& asked = noisy.get(flat::kAsked).values;
  const bool any = std::ranges::any_of(asked, [](float pixel) { return pixel != 0; });
  return any ? denoiser(noisy, progress) : renderOf(noisy);
}

// A run's part of the progress of all.
Progress part(const Progress& progress, size_t i, size_t runs) {
  return {[&progress, i, runs](double done) { progress.at((double(i) + done) / double(runs)); }, progress.stop};
}

}  // namespace

GuideInput guideInput(const DeepImage& image, const DenoisePlan& plan, bool withBins) {
  const DenoiseInputs& inputs = plan.inputs;
  GuideInput result{flattenNoisy(image, inputs), {}, {}, {}};
  if (!withBins) return result;
  if (inputs.halves || inputs.variance)
    result.calm = calmPixels(prepareColours(image, inputs), {}, image, inputs, plan.level);
  result.bins = binImages(image, inputs, kMostBinImages);
  result.shares = binShares(image, kMostBinImages);
  return result;
}

void appendRows(GuideInput& above, const GuideInput& below) {
  appendRows(above.noisy, below.noisy);
  for (size_t k = 0; k < above.bins.size(); ++k) {
    appendRows(above.bins[k], below.bins[k]);
    above.shares[k] += below.shares[k];
  }
  append(above.calm, below.calm);
}

BaseGuide makeGuide(GuideInput input, const GuideDenoisers& denoisers, const DenoisePlan& plan,
                    const Progress& progress) {
  flat::Noise noise = flat::noiseOf(input.noisy);
  noise.level = plan.level;
  double all = 0;
  for (const double share : input.shares) all += share;
  size_t pictures = denoisers.bins ? input.bins.size() : 0;
  while (pictures > 0 && !(input.shares[pictures - 1] > kWorthARun * all)) --pictures;
  BaseGuide guide;
  guide.consistency = denoisers.consistency;
  const Buffer<uint8_t> asked = askedPixels(input, plan);
  ask(input.noisy, asked);
  guide.flattened =
      flat::gated(input.noisy, noise, denoised(denoisers.flattened, input.noisy, part(progress, 0, pictures + 1)));
  for (size_t k = 0; k < pictures; ++k) {
    ask(input.bins[k], asked);
    guide.bins.push_back(denoised(denoisers.bins, input.bins[k], part(progress, k + 1, pictures + 1)));
    input.bins[k] = {};
  }
  guide.noisy = std::move(input.noisy);
  std::erase_if(guide.noisy.planes, [](const flat::Plane& plane) {
    const bool kept = plane.name.size() == 1 || plane.name == "samples" ||
                      (plane.name.starts_with("variance.") && plane.name.size() == 10) ||
                      plane.name.starts_with("half");
    return !kept;
  });
  return guide;
}

BaseGuide guideRows(const BaseGuide& guide, int y0, int y1) {
  const Box& window = guide.noisy.dataWindow;
  const Box box{window.x0, y0, window.x1, y1};
  BaseGuide result{flat::crop(guide.noisy, box), flat::crop(guide.flattened, box), {}, guide.consistency};
  for (const flat::Image& picture : guide.bins) result.bins.push_back(flat::crop(picture, box));
  return result;
}

}  // namespace fathom::deep
