#include "deep/flat_nl_means.h"

#include <string>
#include <utility>

#include "deep/one_bin.h"
#include "flat/error_map.h"

namespace fathom::deep {

namespace {

DeepImage oneBin(const flat::Image& image) {
  DeepImage bins = fromFlat(image);
  makeOneBin(bins);
  return bins;
}

// The image as a flat one, with the count that its noise is of.
flat::Image pixelsOf(const DeepImage& image, const DenoiseInputs& inputs) {
  DeepImage bins = image.copy();
  unmakeOneBin(bins);
  flat::Image pixels = toFlat(bins);
  if (inputs.spp > 0) pixels.attributes["fathom:spp"] = std::to_string(inputs.spp);
  return pixels;
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
  result.params.gate = false;
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

void addErrors(const DeepImage& noisy, const DenoiseInputs& inputs, const flat::Denoiser& denoiser,
               const Progress& progress, DeepImage& denoised) {
  flat::Image errors = flat::errorPlanes(pixelsOf(noisy, inputs), pixelsOf(denoised, inputs), denoiser, {}, progress);
  for (flat::Plane& plane : errors.planes) {
    denoised.erase(plane.name);
    denoised.add(plane.name, PixelType::Float).values = std::move(plane.values);
  }
}

}  // namespace fathom::deep
