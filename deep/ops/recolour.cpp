// What part of its pixel each sample is, is decided once per row; the channels are then products with that.
#include "deep/ops/recolour.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/channels.h"
#include "deep/ops/named_channels.h"
#include "deep/tidy.h"
#include "deep/volume.h"
#include "flat/limited.h"

namespace fathom::deep {

namespace {

// Of an alpha; the largest below 1 stands for 1, so that there is always something to scale.
double opticalDepth(double alpha) {
  return -std::log1p(-std::min(alpha, 1 - 0x1p-24));
}

// The flat image's value at a pixel, 0 outside.
float valueAt(const flat::Image& image, const flat::Plane& plane, int x, int y) {
  return image.dataWindow.contains(x, y) ? finiteOrZero(plane.values[image.dataWindow.index(x, y)]) : 0;
}

std::vector<std::string> planesNamed(const flat::Image& flat, const RecolourParams& params) {
  std::vector<std::string> available;
  for (const flat::Plane& plane : flat.planes) available.push_back(plane.name);
  std::vector<std::string> names = channelsNamed(params.channels, available);
  for (const std::string& name : names)
    if (roleOf(name, PixelType::Float) != Role::Premultiplied) fail("expected channels of colour, found {}", name);
  return names;
}

// What becomes of the samples of a row.
struct Row {
  std::vector<double> part;    // of the pixel's colour
  std::vector<double> factor;  // of premultiplied values that are not recoloured
  std::vector<float> alpha;
};

// Alphas whose optical depths are scaled so that they flatten to `target`.
void scaleAlphas(double target, std::span<float> alphas) {
  double depth = 0, whole = 0;
  for (const float alpha : alphas) depth += opticalDepth(double(alpha)), whole += -std::log1p(-double(alpha));
  if (float(-std::expm1(-whole)) == float(target)) return;
  const double wanted = opticalDepth(target);
  for (float& alpha : alphas) {
    const double own = depth > 0 ? opticalDepth(double(alpha)) / depth : 1 / double(alphas.size());
    alpha = float(-std::expm1(-wanted * own));
  }
}

// Each sample's part of the flattened alpha.
void findParts(std::span<const float> alphas, std::span<double> parts) {
  double depth = 0;
  for (const float alpha : alphas) depth += -std::log1p(-double(alpha));
  const double flattened = -std::expm1(-depth);
  for (size_t i = 0; i < alphas.size(); ++i)
    parts[i] = flattened > 0 ? double(alphas[i]) / flattened : 1 / double(alphas.size());
}

// `offsets` are those of the row's pixels, `given` the alphas of its samples, `matte` the flat alpha of each pixel or
// empty.
Row decideRow(std::span<const uint64_t> offsets, std::span<const float> given, std::span<const float> matte) {
  Row row{std::vector<double>(given.size()), std::vector<double>(given.size(), 1), std::vector<float>(given.size())};
  for (size_t i = 0; i < given.size(); ++i) row.alpha[i] = float(opacity(given[i]));
  for (size_t x = 0; x + 1 < offsets.size(); ++x) {
    const size_t first = offsets[x] - offsets[0], count = offsets[x + 1] - offsets[x];
    const std::span<float> alphas = std::span(row.alpha).subspan(first, count);
    if (!matte.empty()) scaleAlphas(opacity(matte[x]), alphas);
    findParts(alphas, std::span(row.part).subspan(first, count));
  }
  for (size_t i = 0; i < given.size(); ++i)
    if (opacity(given[i]) > 0) row.factor[i] = double(row.alpha[i]) / opacity(given[i]);
  return row;
}

std::vector<float> flatRow(const flat::Image& flat, const flat::Plane& plane, const Box& window, int y) {
  std::vector<float> values;
  for (int x = window.x0; x < window.x1; ++x) values.push_back(valueAt(flat, plane, x, y));
  return values;
}

void colour(std::span<const uint64_t> offsets, const Row& row, std::span<const float> flat, float* values) {
  for (size_t x = 0; x < flat.size(); ++x)
    for (size_t i = offsets[x] - offsets[0]; i < offsets[x + 1] - offsets[0]; ++i)
      values[i] = float(row.part[i] * double(flat[x]));
}

void scale(const Row& row, float* values) {
  for (size_t i = 0; i < row.factor.size(); ++i)
    if (row.factor[i] != 1) values[i] = limited(row.factor[i] * double(finiteOrZero(values[i])));
}

}  // namespace

DeepImage recolour(DeepImage deep, const flat::Image& flat, const RecolourParams& params) {
  const std::vector<std::string> names = planesNamed(flat, params);
  std::as_const(deep).get("A");
  if (params.matte) {
    dropSampleStatistics(deep);
    deep.attributes.erase("fathom:spp");
  }
  for (const std::string& name : statisticsOf(deep, names)) deep.erase(name);
  for (const std::string& name : names)
    if (!deep.find(name)) deep.add(name, PixelType::Float);
  std::vector<Channel*> recoloured, others;
  for (Channel& channel : deep.channels) {
    const bool named = std::ranges::find(names, channel.name) != names.end();
    if (named && channel.type == PixelType::Uint) fail("channel {}: expected a colour, found UINT", channel.name);
    if (named) recoloured.push_back(&channel);
    if (!named && params.matte && roleOf(channel) == Role::Premultiplied) others.push_back(&channel);
  }
  const std::span<float> alpha = deep.get("A");
  const flat::Plane* matte = params.matte ? &flat.get("A") : nullptr;
  const Box& window = deep.dataWindow;
  parallelFor(window.y0, window.y1, [&](int y) {
    const auto offsets =
        std::span<const uint64_t>(deep.offsets).subspan(window.index(window.x0, y), size_t(window.width()) + 1);
    const size_t first = offsets.front(), count = offsets.back() - first;
    const std::vector<float> wanted = matte ? flatRow(flat, *matte, window, y) : std::vector<float>();
    const Row row = decideRow(offsets, alpha.subspan(first, count), wanted);
    for (Channel* channel : recoloured)
      colour(offsets, row, flatRow(flat, flat.get(channel->name), window, y), channel->values.data() + first);
    for (Channel* channel : others) scale(row, channel->values.data() + first);
    if (matte) std::ranges::copy(row.alpha, alpha.begin() + std::ptrdiff_t(first));
  });
  return deep;
}

std::vector<size_t> countUncovered(const DeepImage& deep, const flat::Image& flat, const RecolourParams& params) {
  std::vector<const flat::Plane*> planes{};
  for (const std::string& name : planesNamed(flat, params)) planes.push_back(&flat.get(name));
  if (const flat::Plane* alpha = flat.find("A")) planes.push_back(alpha);
  const Box common = intersect(deep.dataWindow, flat.dataWindow);
  std::vector<size_t> found(size_t(deep.dataWindow.height()), 0);
  for (int y = common.y0; y < common.y1; ++y)
    for (int x = common.x0; x < common.x1; ++x)
      if (deep.count(deep.dataWindow.index(x, y)) == 0)
        found[size_t(y - deep.dataWindow.y0)] +=
            std::ranges::any_of(planes, [&](const flat::Plane* p) { return valueAt(flat, *p, x, y) != 0; });
  return found;
}

}  // namespace fathom::deep
