#include "deep/flat_nl_means.h"

#include <utility>

#include "deep/one_bin.h"

namespace fathom::deep {

namespace {

DeepImage oneBin(const flat::Image& image) {
  DeepImage bins = fromFlat(image);
  makeOneBin(bins);
  return bins;
}

}  // namespace

DenoisePlan planFlat(const flat::Image& image, const DenoiseParams& params) {
  const DeepImage bins = oneBin(image);
  std::vector<std::string> names;
  for (const Channel& channel : bins.channels) names.push_back(channel.name);
  return {findDenoiseInputs(names, bins.attributes), params, meanLevel(bins)};
}

DenoisePlan planFlattened(const DenoisePlan& plan) {
  DenoisePlan result = plan;
  result.inputs.counts = true;
  result.inputs.halfCounts = false;
  result.inputs.volumes = false;
  result.guided = false;
  return result;
}

flat::Denoiser flatNlMeans(const DenoisePlan& plan) {
  return [plan](const flat::Image& noisy, const Progress& progress) {
    DeepImage bins = denoise(oneBin(noisy), plan, progress);
    flat::Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
    for (const char* name : {"R", "G", "B"})
      result.planes.push_back({name, std::exchange(bins.find(name)->values, Buffer<float>())});
    return result;
  };
}

}  // namespace fathom::deep
