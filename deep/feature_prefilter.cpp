#include "deep/feature_prefilter.h"

#include "base/parallel.h"
#include "deep/guide.h"

namespace fathom::deep {

namespace {

// Section 4.2. The feature weight follows depth alone.
JointFilterParams prefilterParams() {
  JointFilterParams params;
  params.radius = kPrefilterRadius;
  params.patchRadius = kPrefilterPatchRadius;
  params.candidates = params.colourCandidates = 1;
  params.kColour = {1.5f, 1.5f};
  params.kFeature = {0.05f, 0.05f, 0.05f};
  params.tau = 0.001f;
  params.crossed = false;
  return params;
}

void packBlock(const DenoiseData& data, const Feature& feature, int block, const Buffer<uint8_t>& skip,
               Buffer<float>& out) {
  const size_t width = size_t(data.width);
  parallelFor(0, data.height, [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel)
      for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]) && !skip[pixel]; ++b) {
        float* o = out.data() + 8 * b + 4 * block;
        for (size_t c = 0; c < 3; ++c) o[c] = feature.value.empty() ? 0 : feature.value[c][b] * data.weight[b];
        o[3] = feature.value.empty() ? 0 : data.weight[b];
      }
  });
}

void takeBlock(const FilterTile& tile, size_t i, size_t bin, int block, Feature& feature) {
  if (feature.value.empty()) return;
  const float* sums = tile.at(i, 0, 0) + 4 * block;
  if (!(sums[3] > 0)) return;
  const float share = tile.own(i, 0, 0)[block] / sums[3];
  if (!feature.own.empty()) feature.own[bin] = share;
  for (size_t c = 0; c < 3; ++c) {
    feature.value[c][bin] = sums[c] / sums[3];
    feature.variance[c][bin] *= share;
  }
}

}  // namespace

void prefilterFeatures(DenoiseData& data, const Activity& activity, int reach) {
  if (data.albedo.value.empty() && data.normal.value.empty()) return;
  const JointFilterParams params = prefilterParams();
  const int pad = params.radius + params.patchRadius;
  const Buffer<uint8_t> unread = allWithin(activity.still, data.width, data.height, reach);
  const Buffer<uint8_t> unseen = allWithin(activity.still, data.width, data.height, featureReach(reach));
  Buffer<float> packed(data.bins() * 8);
  packBlock(data, data.albedo, 0, unseen, packed);
  packBlock(data, data.normal, 1, unseen, packed);
  const Feature& first = data.albedo.value.empty() ? data.normal : data.albedo;
  const Feature& second = data.normal.value.empty() ? data.albedo : data.normal;
  const FeatureGuide guides[2] = {featureGuide(data, first, pad, unseen), featureGuide(data, second, pad, unseen)};
  const std::vector<Buffer<float>> gradient = squaredGradients(data, data.depth, unread);

  JointFilterInput input;
  input.width = data.width;
  input.height = data.height;
  input.rowPhase = data.rowPhase;
  input.offsets = data.offsets;
  input.skip = unread.data();
  input.features = {{data.depth.value[0].data(), data.depth.variance[0].data(), gradient[0].data()}};
  input.components = {
      {packed.data(), {&guides[0].value, &guides[1].value}, {&guides[0].variance, &guides[1].variance}}};
  const auto read = [&](const Box& tile) { return unsigned(activeNear(data, activity, tile, reach)); };
  jointFilter(input, params, read, [&](const FilterTile& tile) {
    size_t i = 0;
    for (int y = tile.box.y0; tile.active && y < tile.box.y1; ++y) {
      const uint64_t* row = data.offsets + size_t(y) * size_t(data.width);
      for (size_t b = size_t(row[tile.box.x0]); b < size_t(row[tile.box.x1]); ++b, ++i) {
        takeBlock(tile, i, b, 0, data.albedo);
        takeBlock(tile, i, b, 1, data.normal);
      }
    }
  });
}

}  // namespace fathom::deep
