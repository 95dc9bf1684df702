#include "deep/base_guide.h"

#include <algorithm>

#include "flat/gate.h"

namespace fathom::deep {

namespace {

constexpr double kWorthARun = 0.02;

void appendRows(flat::Image& above, const flat::Image& below) {
  for (flat::Plane& plane : above.planes) {
    const Buffer<float>& more = below.get(plane.name).values;
    Buffer<float> values(plane.values.size() + more.size());
    std::copy(plane.values.begin(), plane.values.end(), values.begin());
    std::copy(more.begin(), more.end(), values.begin() + plane.values.size());
    plane.values = std::move(values);
  }
  above.dataWindow.y1 = below.dataWindow.y1;
}

// A run's part of the progress of all.
Progress part(const Progress& progress, size_t i, size_t runs) {
  return {[&progress, i, runs](double done) { progress.at((double(i) + done) / double(runs)); }, progress.stop};
}

}  // namespace

GuideInput guideInput(const DeepImage& image, const DenoiseInputs& inputs, bool withBins) {
  GuideInput result{flattenNoisy(image, inputs), {}, {}};
  if (!withBins) return result;
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
}

BaseGuide makeGuide(GuideInput input, const GuideDenoisers& denoisers, float level, const Progress& progress) {
  flat::Noise noise = flat::noiseOf(input.noisy);
  noise.level = level;
  double all = 0;
  for (const double share : input.shares) all += share;
  size_t pictures = denoisers.bins ? input.bins.size() : 0;
  while (pictures > 0 && !(input.shares[pictures - 1] > kWorthARun * all)) --pictures;
  BaseGuide guide;
  guide.consistency = denoisers.consistency;
  guide.flattened = flat::gated(input.noisy, noise, denoisers.flattened(input.noisy, part(progress, 0, pictures + 1)));
  for (size_t k = 0; k < pictures; ++k) {
    guide.bins.push_back(denoisers.bins(input.bins[k], part(progress, k + 1, pictures + 1)));
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
