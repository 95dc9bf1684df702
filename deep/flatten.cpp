// Which sample contributes how much to a pixel is decided once per row of the image; the channels are then sums over
// that.
#include "deep/flatten.h"

#include <algorithm>
#include <array>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/channels.h"
#include "deep/flat_attributes.h"
#include "deep/row_weights.h"
#include "flat/limited.h"

namespace fathom::deep {

namespace {

constexpr int kRows = 8;  // of a tile; its scratch is allocated once

float PixelDepths::*memberOf(FlatDepth depth) {
  switch (depth) {
    case FlatDepth::Front:
      return &PixelDepths::front;
    case FlatDepth::Back:
      return &PixelDepths::back;
    case FlatDepth::Transmittance:
      return &PixelDepths::passing;
    default:
      return &PixelDepths::mean;
  }
}

std::string channelOf(FlatDepth depth) {
  switch (depth) {
    case FlatDepth::Front:
      return "Z.front";
    case FlatDepth::Back:
      return "Z.back";
    case FlatDepth::Transmittance:
      return "Z.transmittance";
    default:
      return "Z.mean";
  }
}

bool hasFlatForm(const Channel& channel, const FlattenParams& params) {
  const Role role = roleOf(channel);
  return role != Role::Statistic && role != Role::Identifier && channel.name != "ZBack" &&
         std::ranges::find(params.depths, channel.name, channelOf) == params.depths.end();
}

// A plane of the result and what it is made of.
struct Sum {
  const float* values;  // per sample
  float* out;           // per pixel
};
struct Depth {
  float PixelDepths::*which;
  float* out;
};
struct Outputs {
  std::vector<Sum> composited, means;
  std::vector<Depth> depths;
  float* alpha = nullptr;
};

// Adds the planes to `result`, in the order of the channels.
Outputs planOutputs(const DeepImage& image, const FlattenParams& params, flat::Image& result) {
  Outputs outputs;
  const auto add = [&](const std::string& name) {
    result.planes.push_back({name, Buffer<float>(result.dataWindow.area())});
    return result.planes.back().values.data();
  };
  for (const Channel& channel : image.channels) {
    if (!hasFlatForm(channel, params)) continue;
    const Role role = roleOf(channel);
    float* out = add(channel.name);
    if (role == Role::Alpha)
      outputs.alpha = out;
    else if (role == Role::Depth)
      outputs.depths.push_back({memberOf(params.z), out});
    else
      (role == Role::Plain ? outputs.means : outputs.composited).push_back({channel.values.data(), out});
  }
  for (const FlatDepth depth : params.depths)
    if (!result.find(channelOf(depth))) outputs.depths.push_back({memberOf(depth), add(channelOf(depth))});
  return outputs;
}

// A row of pixels, the first one's number in the image, and where their samples begin.
struct Row {
  const RowWeights& weights;
  size_t first, width;
  const uint64_t* offsets;
};

constexpr size_t kTogether = 3;  // channels that are summed at once: a colour

void composite(const Row& row, const std::array<Sum, kTogether>& sums) {
  const double* weights = row.weights.premultiplied.data();
  const uint64_t begin = row.offsets[0];
  for (size_t x = 0; x < row.width; ++x) {
    std::array<double, kTogether> total = {};
    for (size_t i = row.offsets[x]; i < row.offsets[x + 1]; ++i)
      for (size_t c = 0; c < kTogether; ++c) total[c] += weights[i - begin] * double(finiteOrZero(sums[c].values[i]));
    for (size_t c = 0; c < kTogether; ++c) sums[c].out[row.first + x] = limited(total[c]);
  }
}

void average(const Row& row, const Sum& sum) {
  for (size_t x = 0; x < row.width; ++x) {
    const double alpha = row.weights.alpha[x];
    double total = 0;
    for (size_t i = row.offsets[x]; i < row.offsets[x + 1] && alpha > 0; ++i)
      total += row.weights.seen[i - row.offsets[0]] / alpha * double(finiteOrZero(sum.values[i]));
    sum.out[row.first + x] = float(total);
  }
}

void write(const Row& row, const Outputs& outputs) {
  const auto at = [&](size_t i) { return outputs.composited[std::min(i, outputs.composited.size() - 1)]; };
  for (size_t i = 0; i < outputs.composited.size(); i += kTogether) composite(row, {at(i), at(i + 1), at(i + 2)});
  for (const Sum& sum : outputs.means) average(row, sum);
  for (size_t x = 0; x < row.width; ++x) outputs.alpha[row.first + x] = float(row.weights.alpha[x]);
  for (const Depth& depth : outputs.depths)
    for (size_t x = 0; x < row.width; ++x) depth.out[row.first + x] = row.weights.depths[x].*depth.which;
}

}  // namespace

flat::Image flatten(const DeepImage& image, const FlattenParams& params) {
  if (!(params.transmittance >= 0 && params.transmittance < 1))
    fail("transmittance: expected at least 0 and below 1, found {}", params.transmittance);
  const bool ends = params.z != FlatDepth::Mean || !params.depths.empty();
  (void)RowCompositor(image);  // throws for images without rows, too
  flat::Image result{image.dataWindow, image.displayWindow, {}, flatAttributes(image.attributes)};
  const Outputs outputs = planOutputs(image, params, result);
  const size_t width = size_t(image.dataWindow.width());
  parallelRanges(0, image.dataWindow.height(), kRows, [&](int y0, int y1) {
    RowCompositor compositor(image, ends, params.transmittance);
    for (size_t first = size_t(y0) * width; first < size_t(y1) * width; first += width)
      write({compositor.composite(first, first + width), first, width, image.offsets.data() + first}, outputs);
  });
  return result;
}

}  // namespace fathom::deep
