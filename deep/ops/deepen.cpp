#include "deep/ops/deepen.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "deep/channels.h"
#include "deep/flat_attributes.h"
#include "deep/one_bin.h"
#include "deep/ops/sample_plan.h"
#include "deep/tidy.h"
#include "deep/volume.h"

namespace fathom::deep {

namespace {

bool isColour(const std::string& name) {
  const std::string last = name.substr(name.rfind('.') + 1);
  return last == "R" || last == "G" || last == "B";
}

std::vector<std::span<const float>> coloursOf(const DeepImage& image) {
  std::vector<std::span<const float>> colours;
  for (const Channel& channel : image.channels)
    if (isColour(channel.name) && roleOf(channel) == Role::Premultiplied) colours.emplace_back(channel.values);
  return colours;
}

// Brings the depths to Z, and to ZBack where there are volumes.
void setDepths(DeepImage& image, const DeepenParams& params) {
  const bool ownZ = !params.z && params.depthChannel == "Z";
  if (params.z) {
    image.add("Z", PixelType::Float).values.fill(*params.z);
  } else if (!ownZ) {
    image.erase("Z");
    image.find(params.depthChannel)->name.assign(1, 'Z');
  }
  if (!ownZ || params.thickness > 0) image.erase("ZBack");
  if (!(params.thickness > 0)) return;
  Channel& back = image.add("ZBack", PixelType::Float);
  const std::span<const float> z = image.get("Z");
  for (size_t i = 0; i < z.size(); ++i) back.values[i] = z[i] + params.thickness;
}

// The part of A and of colours per unit of length that a sample of this thickness has.
Part partOfExtinction(float extinction, float thickness) {
  const double depth = extinction > 0 && isFinite(extinction) ? double(extinction) * thickness : 0;
  if (depth == 0) return {0, thickness};
  const double alpha = -std::expm1(-depth);
  return {alpha, alpha / depth * thickness};
}

}  // namespace

DeepImage deepen(const flat::Image& image, const DeepenParams& params) {
  if (!params.z) image.get(params.depthChannel);
  if (params.extinction && !(params.thickness > 0))
    fail("deepen: expected a thickness above 0 for extinction, found {}", params.thickness);
  DeepImage samples = fromFlat(image);
  samples.attributes = deepAttributes(image.attributes);
  setDepths(samples, params);
  if (!samples.find("A")) samples.add("A", PixelType::Float).values.fill(1);
  if (params.extinction) dropSampleStatistics(samples);
  const std::span<const float> alpha = samples.get("A"), z = samples.get("Z");
  const std::vector<std::span<const float>> colours = coloursOf(samples);
  const auto isEmpty = [&](size_t i) {
    return std::isnan(z[i]) ||
           (opacity(alpha[i]) == 0 && std::ranges::all_of(colours, [&](auto c) { return finiteOrZero(c[i]) == 0; }));
  };
  return mapRows(samples, [&](int y, RowPlan& row) {
    for (int x = samples.dataWindow.x0; x < samples.dataWindow.x1; ++x) {
      const size_t i = samples.dataWindow.index(x, y);
      row.nextPixel();
      if (isEmpty(i)) continue;
      if (!params.extinction) {
        row.keep(i);
        continue;
      }
      const Part part = partOfExtinction(alpha[i], params.thickness);
      row.change(i, z[i], z[i] + params.thickness, float(part.alpha), float(part.weight));
    }
  });
}

}  // namespace fathom::deep
