// Random frames as the network takes them, and what it makes of them.
#pragma once

#include "base/progress.h"
#include "nn/tiles.h"
#include "tests/reference/compositional.h"

namespace fathom::reference {

inline nn::WeightFile fileOf(const PlainWeights& weights) {
  return nn::readWeights(reference::safetensors(weights), "random");
}

// Random planes and colours, and what of them a network takes.
struct Frame {
  Volume planes, colour;
  std::vector<float> planeValues, colourValues;

  Frame(int height, int width, uint32_t seed)
      : planes(randomVolume(nn::kInputPlanes, height, width, seed, -1, 1)),
        colour(randomVolume(3, height, width, seed + 1, 0, 3)),
        planeValues(floatsOf(planes)),
        colourValues(floatsOf(colour)) {}

  nn::CompositionalInput input() const {
    return {nn::denseRows(planeValues.data(), nn::kInputPlanes, colour.height, colour.width),
            nn::denseRows(colourValues.data(), 3, colour.height, colour.width), colour.height, colour.width};
  }
  size_t values() const { return colourValues.size(); }
};

inline std::vector<float> whole(const nn::CompositionalNet& net, const Frame& frame, int components) {
  std::vector<float> result(frame.values(), -1.0f);
  nn::CompositionalNet::Workspace workspace;
  const nn::CompositionalInput input = frame.input();
  net.denoise(input, {0, 0, input.width, input.height}, components,
              nn::denseRows(result.data(), 3, input.height, input.width), workspace);
  return result;
}

inline std::vector<float> tiled(const nn::CompositionalNet& net, const Frame& frame, const nn::TileParams& params,
                                const std::function<nn::BlockWorth(const nn::Window&)>& worth = {},
                                const Progress& progress = {}) {
  std::vector<float> result(frame.values(), -1.0f);
  const nn::CompositionalInput input = frame.input();
  const std::vector<nn::Tile> tiles = nn::planTiles(net, input.height, input.width, params, worth);
  nn::denoiseTiles(net, input, tiles, nn::denseRows(result.data(), 3, input.height, input.width), params.memory,
                   progress);
  return result;
}

// In the smallest tiles.
inline nn::TileParams small(int components) {
  return {.memory = 1, .least = components, .most = components};
}

template <class T>
double largest(const std::vector<T>& values) {
  double most = 0;
  for (const T v : values) most = std::max(most, std::fabs(double(v)));
  return most;
}

template <class A, class B>
double largestDifference(const std::vector<A>& a, const std::vector<B>& b) {
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i) most = std::max(most, std::fabs(double(a[i]) - double(b[i])));
  return most;
}

}  // namespace fathom::reference
