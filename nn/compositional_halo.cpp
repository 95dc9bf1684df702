#include "nn/compositional_halo.h"

#include <algorithm>
#include <vector>

#include "nn/kernel_filter.h"

namespace fathom::nn {

namespace {

// How far `needed` reaches beyond a tile of `alignment` pixels that begins at 0.
int haloOf(const Interval& needed, int alignment) {
  const int pixels = std::max({-needed.begin, needed.end - alignment, 0});
  return (pixels + alignment - 1) / alignment * alignment;
}

// The pixels of the smaller image that a bilinear enlargement takes `out` from.
Interval enlargedFrom(const Interval& out) {
  const auto below = [](int x) { return (x + 4096) / 2 - 2048; };  // rounds down
  return {below(out.begin - 1), below(out.end) + 1};
}

Interval halvedFrom(const Interval& out) {
  return {2 * out.begin, 2 * out.end};
}

// What a tile takes of the features and of the colour of a level, along one axis.
struct Reach {
  Interval features, colour;
};

// Inputs of graphs are a colour's logarithm and features; the colour itself is needed, too.
template <class Values>
Reach reachOf(const Values& values, const std::map<int, Interval>& wanted, const Interval& colour) {
  const std::vector<Interval> needed = values.graph.reach(wanted);
  const bool colourFirst = values.graph.inputs()[0].index == values.colour.index;
  return {needed[colourFirst ? 1 : 0], needed[colourFirst ? 0 : 1].with(colour)};
}

// r0 = d0 + a0 U(r1 - D(d0)), r1 = d1 + a1 U(d2 - D(d1)): which kernels and colours a tile takes.
Reach denoiseReach(const DenoiseGraph& values, const Interval& tile) {
  const Interval r1 = enlargedFrom(tile), d0 = halvedFrom(r1).with(tile);
  const Interval d2 = enlargedFrom(r1), d1 = halvedFrom(d2).with(r1);
  const Interval c2 = d2.around(kKernelWidth / 2);
  const Interval c1 = halvedFrom(c2).with(d1.around(kKernelWidth / 2));
  const Interval c0 = halvedFrom(c1).with(d0.around(kKernelWidth / 2));
  return reachOf(values, {{values.kernel[0].index, d0}, {values.kernel[1].index, d1}, {values.kernel[2].index, d2}},
                 c0);
}

// What the parts of a colour, as far as they are needed, take of the whole.
Reach decomposeReach(const DecomposeGraph& values, const Reach& parts) {
  return reachOf(
      values,
      {{values.mask.index, parts.colour}, {values.first.index, parts.features}, {values.second.index, parts.features}},
      parts.colour);
}

}  // namespace

Halos halosOf(const EncoderGraph& encoder, const DecomposeGraph& decompose, const DenoiseGraph& denoise,
              int alignment) {
  Halos halos;
  Reach reach = denoiseReach(denoise, {0, alignment});
  for (size_t splits = 0; splits < halos.level.size(); ++splits) {
    if (splits > 0) reach = decomposeReach(decompose, reach);
    halos.level[splits] = haloOf(reach.features.with(reach.colour), alignment);
    const Interval planes = encoder.graph.reach({{encoder.features.index, reach.features}})[0];
    halos.encoder[splits] = haloOf(planes.with(reach.colour), alignment);
  }
  return halos;
}

}  // namespace fathom::nn
