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

// R, G and B of such bins, which are taken.
flat::Image coloursOf(DeepImage bins) {
  flat::Image result{bins.dataWindow, bins.displayWindow, {}, {}};
  for (const char* name : flat::kRgbNames)
    result.planes.push_back({name, std::exchange(bins.find(name)->values, Buffer<float>())});
  return result;
}

void addPlanes(flat::Image errors, DeepImage& denoised) {
  for (flat::Plane& plane : errors.planes) {
    denoised.erase(plane.name);
    denoised.add(plane.name, PixelType::Float).values = std::move(plane.values);
  }
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
    return coloursOf(denoise(oneBin(noisy), plan, progress));
  };
}

FlatAnswer answerNlMeans(const flat::Image& noisy, const DenoisePlan& plan, const Progress& progress) {
  FlatAnswer answer;
  answer.denoised = coloursOf(denoise(oneBin(noisy), plan, progress, nullptr, nullptr, &answer.response));
  return answer;
}

flat::Estimator nlMeansEstimator(const DenoisePlan& plan) {
  return [plan](const flat::Image& noisy, const flat::Noise& noise, const Progress& progress) {
    FlatAnswer answer = answerNlMeans(noisy, plan, progress);
    flat::ErrorEstimate estimate = flat::estimateError(noisy, noise, answer.denoised, std::move(answer.response));
    return flat::Answer{std::move(answer.denoised), std::move(estimate)};
  };
}

void addErrors(const DeepImage& noisy, const DenoiseInputs& inputs, const flat::Denoiser& denoiser,
               const Progress& progress, DeepImage& denoised) {
  addPlanes(flat::errorPlanes(pixelsOf(noisy, inputs), pixelsOf(denoised, inputs), denoiser, {}, progress), denoised);
}

void addErrors(const DeepImage& noisy, const DenoiseInputs& inputs, flat::NoiseResponse response, DeepImage& denoised) {
  const flat::Image pixels = pixelsOf(noisy, inputs), result = pixelsOf(denoised, inputs);
  const flat::Noise noise = flat::noiseOf(pixels);
  addPlanes(flat::errorPlanes(flat::estimateError(pixels, noise, result, std::move(response)), noise, result),
            denoised);
}

}  // namespace fathom::deep
