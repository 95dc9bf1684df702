#include "deep/bin_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/alpha.h"
#include "deep/denoise_data.h"
#include "flat/denoiser.h"

namespace fathom::deep {

namespace {

constexpr std::array<const char*, 3> kRgb{"R", "G", "B"};

using Colour = std::array<std::span<const float>, 3>;

Colour coloursOf(const DeepImage& image) {
  return {image.get("R"), image.get("G"), image.get("B")};
}

// Calls body(pixel, bin, k) for the k-th visible bin of each pixel of the image, for all k.
template <class Body>
void forVisible(const DeepImage& image, const Body& body) {
  const Buffer<float> weight = effectiveAlpha(image);
  const Colour colour = coloursOf(image);
  const int width = image.dataWindow.width();
  parallelFor(0, image.dataWindow.height(), [&](int y) {
    for (size_t pixel = size_t(y) * size_t(width); pixel < (size_t(y) + 1) * size_t(width); ++pixel) {
      int k = 0;
      for (size_t b = size_t(image.offsets[pixel]); b < size_t(image.offsets[pixel + 1]); ++b) {
        const bool finite = isFinite(colour[0][b]) && isFinite(colour[1][b]) && isFinite(colour[2][b]);
        if (weight[b] >= kLeastShare && finite) body(pixel, b, k++);
      }
    }
  });
}

}  // namespace

std::vector<flat::Image> binImages(const DeepImage& image, const DenoiseInputs& inputs, int count) {
  std::vector<std::string> names{"R", "G", "B"};
  for (const char* name : {"albedo.R", "albedo.G", "albedo.B"})
    if (inputs.albedo) names.emplace_back(name);
  for (const char* name : {"N.X", "N.Y", "N.Z"})
    if (inputs.normal) names.emplace_back(name);
  std::vector<flat::Image> result;
  for (int k = 0; k < count; ++k) {
    flat::Image& picture = result.emplace_back(flat::Image{image.dataWindow, image.displayWindow, {}, {}});
    for (const std::string& name : names) picture.add(name);
    picture.add("A");
    picture.add(flat::kAsked);
  }
  const std::span<const float> alpha = image.get("A");
  std::vector<std::span<const float>> planes;
  for (const std::string& name : names) planes.push_back(image.get(name));
  forVisible(image, [&](size_t pixel, size_t bin, int k) {
    // It stands for the images to come, too, until a bin farther behind replaces it there.
    const float inverse = 1 / std::min(alpha[bin], 1.0f);
    for (size_t i = size_t(k); i < result.size(); ++i) {
      for (size_t c = 0; c < planes.size(); ++c)
        result[i].planes[c].values[pixel] = finiteOrZero(planes[c][bin] * inverse);
      result[i].planes[planes.size()].values[pixel] = 1;
    }
    if (size_t(k) < result.size()) result[size_t(k)].planes.back().values[pixel] = 1;
  });
  return result;
}

std::vector<double> binShares(const DeepImage& image, int count) {
  const Buffer<float> weight = effectiveAlpha(image);
  const int height = image.dataWindow.height();
  const size_t width = size_t(image.dataWindow.width());
  std::vector<double> rows(size_t(height) * size_t(count), 0.0);  // summed in their order
  forVisible(image, [&](size_t pixel, size_t bin, int k) {
    if (k < count) rows[pixel / width * size_t(count) + size_t(k)] += double(weight[bin]);
  });
  std::vector<double> result(size_t(count), 0.0);
  for (size_t i = 0; i < rows.size(); ++i) result[i % size_t(count)] += rows[i];
  return result;
}

Buffer<float> fromBinImages(const DeepImage& image, std::span<const flat::Image> images) {
  Buffer<float> result(image.samples() * 3, std::numeric_limits<float>::quiet_NaN());
  if (images.empty()) return result;
  const Box &box = image.dataWindow, &from = images[0].dataWindow;
  if (box.x0 != from.x0 || box.x1 != from.x1 || box.y0 < from.y0 || box.y1 > from.y1)
    fail("expected pictures of bins over the rows {} to {}, found {} to {}", box.y0, box.y1 - 1, from.y0, from.y1 - 1);
  const size_t before = size_t(box.y0 - from.y0) * size_t(box.width());
  std::vector<std::array<const float*, 3>> planes;
  for (const flat::Image& picture : images) {
    auto& rgb = planes.emplace_back();
    for (size_t c = 0; c < 3; ++c) rgb[c] = picture.get(kRgb[c]).values.data() + before;
  }
  forVisible(image, [&](size_t pixel, size_t bin, int k) {
    for (size_t c = 0; c < 3 && size_t(k) < planes.size(); ++c) result[3 * bin + c] = planes[size_t(k)][c][pixel];
  });
  return result;
}

}  // namespace fathom::deep
