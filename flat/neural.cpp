#include "flat/neural.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/light.h"
#include "flat/neural_planes.h"
#include "flat/noise.h"
#include "nn/tiles.h"

namespace fathom::flat {

namespace {

// Of a pixel: the planes, the colour and the network's result; ours, of three lights; a factor; and what is known of
// the noise.
constexpr size_t kPixelBytes = (nn::kInputPlanes + 3 + 3 + 9 + 1) * sizeof(float) + 20;
constexpr int kLargestTile = 512, kSmallestTile = 64;  // of nn/tiles

// Without coefficients nothing tells what components are worth.
int mostComponents(const nn::CompositionalNet& net, const NeuralParams& params) {
  if (params.components > 0) return params.components;
  return net.gains().known() ? nn::kMostComponents : 1;
}

nn::TileParams tileParams(const nn::CompositionalNet& net, const NeuralParams& params) {
  return {.memory = params.memory, .least = std::max(params.components, 1), .most = mostComponents(net, params)};
}

// 1 where the render stays: it has converged, there is nothing, or nobody asks.
Buffer<uint8_t> settledPixels(const Image& image) {
  const size_t pixels = image.dataWindow.area();
  Buffer<uint8_t> settled(pixels, 0);
  if (tellsNoise(image)) {
    const Noise noise = noiseOf(image);
    for (size_t i = 0; i < pixels; ++i) settled[i] = noise.pixel[i] == PixelNoise::Converged;
  }
  if (const Plane* asked = image.find(kAsked))
    for (size_t i = 0; i < pixels; ++i) settled[i] |= uint8_t(asked->values[i] == 0);
  const Plane* alpha = image.find("A");
  if (!alpha) return settled;
  const std::array<const float*, 3> rgb{image.get("R").values.data(), image.get("G").values.data(),
                                        image.get("B").values.data()};
  for (size_t i = 0; i < pixels; ++i)
    if (alpha->values[i] == 0 && rgb[0][i] == 0 && rgb[1][i] == 0 && rgb[2][i] == 0) settled[i] = 1;
  return settled;
}

// The smallest window around the pixels of a block that are not settled, at multiples of 4; of no area where there is none.
nn::Window unsettledPart(const Buffer<uint8_t>& settled, const Box& window, const nn::Window& block) {
  const int right = std::min(block.x + block.width, window.width()),
            bottom = std::min(block.y + block.height, window.height());
  int x0 = right, y0 = bottom, x1 = block.x, y1 = block.y;
  for (int y = block.y; y < bottom; ++y) {
    const uint8_t* row = settled.data() + size_t(y) * size_t(window.width());
    const uint8_t* first = std::find(row + block.x, row + right, uint8_t(0));
    if (first == row + right) continue;
    int last = right;
    while (row[last - 1]) --last;
    x0 = std::min(x0, int(first - row)), x1 = std::max(x1, last);
    y0 = std::min(y0, y), y1 = y + 1;
  }
  if (x0 >= x1) return {};
  x0 -= x0 % 4, y0 -= y0 % 4, x1 += -x1 & 3, y1 += -y1 & 3;
  return {x0, y0, x1 - x0, y1 - y0};
}

float clean(float value) {
  return std::max(finiteOrZero(value), 0.0f);
}

// What the network makes of light that was divided can be brighter than all light that there was.
float bounded(float value) {
  return value > 0 ? std::min(value, kLargest) : 0.0f;
}

// One light through the network, into planes of the result.
class LightRun {
 public:
  LightRun(const nn::CompositionalNet& net, const NeuralParams& params, const Image& noisy, NeuralCounts* counts)
      : net_(net), params_(params), noisy_(noisy), counts_(counts), settled_(settledPixels(noisy)), planes_(noisy) {}

  void run(Light light, const Progress& progress, Image& result) {
    planes_.select(light);
    const nn::CompositionalInput input = planes_.input();
    const nn::TileParams tiling = tileParams(net_, params_);
    const std::vector<nn::Tile> tiles =
        nn::planTiles(net_, input.height, input.width, tiling,
                      [&](const nn::Window& block) { return worthOf(input, block, tiling.most > tiling.least); });
    if (counts_) count(tiles);
    Buffer<float> out(3 * size_t(planes_.height()) * size_t(planes_.width()), 0.0f);
    nn::denoiseTiles(net_, input, tiles, nn::denseRows(out.data(), 3, planes_.height(), planes_.width()),
                     params_.memory, progress);
    for (size_t c = 0; c < 3; ++c) {
      const std::string name = prefixOf(light) + kRgbNames[c];
      take(c, out.data() + c * size_t(planes_.height()) * size_t(planes_.width()), noisy_.get(name).values,
           result.add(name).values);
    }
  }

  // The whole light from its two parts, but for what is settled.
  void add(Image& result) const {
    for (const char* c : kRgbNames) {
      Buffer<float> sum(settled_.size());
      const Buffer<float>&diffuse = result.get(prefixOf(Light::Diffuse) + c).values,
            &specular = result.get(prefixOf(Light::Specular) + c).values, &render = noisy_.get(c).values;
      for (size_t i = 0; i < sum.size(); ++i)
        sum[i] = settled_[i] ? clean(render[i]) : bounded(diffuse[i] + specular[i]);
      result.planes.push_back({c, std::move(sum)});
    }
  }

  void keepLight(Image& result) const { flat::keepLight(noisy_, settled_, result, 1 / planes_.exposure()); }

 private:
  nn::BlockWorth worthOf(const nn::CompositionalInput& input, const nn::Window& block, bool open) const {
    nn::BlockWorth worth{.within = unsettledPart(settled_, noisy_.dataWindow, block)};
    worth.work = worth.within.width > 0;
    if (worth.work && open)
      worth.gain = net_.gains().of(nn::blockStatistics(input.planes.at(block.x, block.y), block.height, block.width));
    return worth;
  }

  void count(const std::vector<nn::Tile>& tiles) const {
    uint64_t done = 0;
    for (const auto& [window, components] : tiles) {
      const uint64_t pixels = uint64_t(window.width) * uint64_t(window.height);
      done += pixels;
      if (components == 2) counts_->inTwo += pixels;
      if (components == 4) counts_->inFour += pixels;
    }
    counts_->denoised += done;
    counts_->skipped += uint64_t(planes_.width()) * uint64_t(planes_.height()) - done;
  }

  // Out of the network's exposure, and times the albedo.
  void take(size_t c, const float* exposed, const Buffer<float>& render, Buffer<float>& to) const {
    const int width = noisy_.dataWindow.width();
    parallelFor(0, noisy_.dataWindow.height(), [&](int y) {
      const float* from = exposed + size_t(y) * size_t(planes_.width());
      for (size_t x = 0; x < size_t(width); ++x) {
        const size_t i = size_t(y) * size_t(width) + x;
        to[i] = settled_[i] ? clean(render[i]) : bounded(from[x] * planes_.restoring(c, y, int(x)));
      }
    });
  }

  const nn::CompositionalNet& net_;
  const NeuralParams& params_;
  const Image& noisy_;
  NeuralCounts* counts_;
  const Buffer<uint8_t> settled_;
  NeuralPlanes planes_;
};

}  // namespace

Image denoiseNeural(const nn::CompositionalNet& net, const NeuralParams& params, const Image& noisy,
                    const Progress& progress, NeuralCounts* counts) {
  progress.at(0);
  Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  LightRun light(net, params, noisy, counts);
  const bool apart = hasLight(noisy, Light::Diffuse) && hasLight(noisy, Light::Specular);
  if (apart) {
    light.run(Light::Diffuse, {[&](double done) { progress.at(done / 2); }, progress.stop}, result);
    light.run(Light::Specular, {[&](double done) { progress.at((1 + done) / 2); }, progress.stop}, result);
    light.add(result);
  } else {
    light.run(Light::Whole, progress, result);
  }
  light.keepLight(result);
  return result;
}

Denoiser neural(std::shared_ptr<const nn::CompositionalNet> net, const NeuralParams& params,
                std::shared_ptr<NeuralCounts> counts) {
  return [net = std::move(net), params, counts = std::move(counts)](const Image& noisy, const Progress& progress) {
    return denoiseNeural(*net, params, noisy, progress, counts.get());
  };
}

size_t neuralBytes(const nn::CompositionalNet& net, const NeuralParams& params, size_t pixels) {
  const int components = mostComponents(net, params);
  const double halo = 2.0 * net.halo(components), perPixel = net.bytesPerPixel(components);
  const double least = perPixel * (kSmallestTile + halo) * (kSmallestTile + halo);
  const double grown = (kLargestTile + halo) / kLargestTile;
  // At most all tiles are worked on at once, each with its halo as far as there is a frame.
  const double work = perPixel * grown * grown * double(pixels);
  return pixels * kPixelBytes + size_t(params.memory ? std::min(work, std::max(double(params.memory), least)) : work);
}

}  // namespace fathom::flat
