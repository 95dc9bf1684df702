// The last step of a band: what the kernels make of the sums in each layer, tile by tile.
#include <algorithm>
#include <atomic>

#include "base/parallel.h"
#include "nn/kernel_filter.h"
#include "nn/layers_band.h"

namespace fathom::nn {

namespace {

constexpr float kAround = 0.125f;  // the weight of the divisor around a pixel beside that of its own samples
constexpr float kTiny = 1e-12f;

}  // namespace

// Layers of one tile.
class LayersBand::TileFilter {
 public:
  TileFilter(LayersBand& band, const Window& tile) : band_(band), net_(band.net_), whole_(tile) {}

  // False where there is nothing in the layer.
  bool run(int layer) {
    tile_ = near(whole_, net_.filterHalo(), band_.height_, band_.width_, LayersNet::kAlignment,
                 [&](int x, int y) { return band_.sumRow(band_.lights_.front(), layer, 3, y)[x] != 0; });
    if (area(tile_) == 0) return false;
    from_ = grown(tile_, net_.filterHalo(), band_.height_, band_.width_);
    for (Light& light : band_.lights_) {
      shrink(light, layer);
      for (int i = 0; i < kLayerScales; ++i) filter(light, i);
      join(light);
      if (light.divided()) multiply();
      addToResult(layer);
    }
    return true;
  }

 private:
  Window insideBand() const { return {from_.x, from_.y - band_.sumRows_.begin, from_.width, from_.height}; }

  // Colours as they are, what covers and how far away that is by the number of lights.
  void addToResult(int layer) const {
    float* result = band_.results_[size_t(layer)].data();
    const size_t rows = size_t(band_.rows_.end - band_.rows_.begin);
    for (size_t p = 0; p < kLayerPlanes; ++p) {
      const float part = p < 3 ? 1.0f : 1.0f / float(band_.lights_.size());
      for (int y = tile_.y; y < tile_.y + tile_.height; ++y) {
        const float* from = joined_.row(p, y - from_.y) + tile_.x - from_.x;
        float* to = result + (p * rows + size_t(y - band_.rows_.begin)) * size_t(band_.width_) + tile_.x;
        for (int x = 0; x < tile_.width; ++x) to[x] += part * from[x];
      }
    }
  }

  // What is splatted, and embeddings, at all scales.
  void shrink(Light& light, int layer) {
    const int groups = int(band_.groups()), block = net_.block();
    for (int i = 0; i < kLayerScales; ++i) {
      const int height = from_.height >> i, width = from_.width >> i;
      values_[i].resize(light.splatted(), height, width);
      embedding_[i] = Buffer<float>(size_t(groups * block) * size_t(height) * size_t(width));
      if (i == 0) {
        for (size_t p = 0; p < light.splatted(); ++p)
          for (int y = 0; y < height; ++y)
            std::copy_n(band_.sumRow(light, layer, p, from_.y + y) + from_.x, width, values_[0].row(p, y));
        cropGroups(reinterpret_cast<const std::byte*>(light.sums[size_t(layer)].embedding.data()), size_t(groups),
                   band_.sumHeight(), band_.width_, size_t(block) * sizeof(float), insideBand(),
                   reinterpret_cast<std::byte*>(embedding_[0].data()));
      } else {
        const size_t planes = light.splatted();
        halve(std::as_const(values_[i - 1]).planes(planes), 2 * height, 2 * width, values_[i].planes(planes));
        halveGroups(embedding_[i - 1].data(), groups, 2 * height, 2 * width, block, embedding_[i].data());
      }
      values_[i].clearBorders();
    }
  }

  void filter(const Light& light, int i) {
    const int height = from_.height >> i, width = from_.width >> i;
    const auto plan = net_.kernel(i).plan(height, width);
    Buffer<std::byte> arena(plan->layout().bytes), input(embedding_[i].size() * bytesOf(net_.element())),
        context(input.size());
    toElements(embedding_[i].data(), embedding_[i].size(), net_.element(), input.data());
    cropGroups(light.kernel[i].data(), band_.groups(), band_.sumHeight() >> i, band_.width_ >> i, band_.pixelBytes(),
               scaled(insideBand(), i), context.data());
    const std::byte* inputs[] = {input.data(), context.data()};
    plan->run(inputs, arena.data());
    const std::byte* logits = Plan::result(*plan, arena.data(), net_.kernelValues(i).logits);
    splat(reinterpret_cast<const float*>(logits), net_.block(), values_[i], light.divided(), splatted_[i],
          i ? nullptr : &shares_);
  }

  void join(const Light& light) {
    const size_t planes = light.made();
    const std::vector<float> ones(size_t(from_.width), 1.0f);
    scaleRows(shares_, splatted_[0], planes, joined_);
    const auto enlarge = [&](WidePlanes& to, const float* factor, ptrdiff_t stride, const WidePlanes& from) {
      addEnlarged(to.planes(planes), to.height(), to.width(), factor, stride, from.planes(planes));
    };
    enlarge(joined_, shares_.row(1, 0), shares_.stride(), splatted_[1]);
    half_.resize(planes, from_.height / 2, from_.width / 2);
    for (size_t p = 0; p < planes; ++p)
      for (int y = 0; y < half_.height(); ++y) std::fill_n(half_.row(p, y), half_.width(), 0.0f);
    enlarge(half_, ones.data(), 0, splatted_[2]);
    enlarge(joined_, shares_.row(2, 0), shares_.stride(), half_);
  }

  // By the divisor of a pixel's own samples in the layer, and, beside them, what the kernels make of it. Where bright light
  // comes of little albedo, as through leaves and curtains, the mean of quotients times that of divisors is too much: what
  // the kernels make of the light before, over what they make of divisors, is the most.
  void multiply() {
    for (int y = tile_.y - from_.y; y < tile_.y - from_.y + tile_.height; ++y) {
      const float *weight = values_[0].row(3, y), *alpha = joined_.row(3, y);
      for (size_t c = 0; c < 3; ++c) {
        const float *own = values_[0].row(kSplatted + c, y), *divisor = joined_.row(kLayerPlanes + c, y),
                    *before = joined_.row(kLayerPlanes + 3 + c, y);
        float* light = joined_.row(c, y);
        for (int x = tile_.x - from_.x; x < tile_.x - from_.x + tile_.width; ++x) {
          const float around = std::max(divisor[x] / std::max(alpha[x], kTiny), kLeastAlbedo);
          light[x] = std::min(light[x], before[x] / around) * (own[x] + kAround * around) / (weight[x] + kAround);
        }
      }
    }
  }

  LayersBand& band_;
  const LayersNet& net_;
  const Window whole_;
  Window tile_, from_;  // what is worked on of it, and what that takes
  WidePlanes values_[kLayerScales], splatted_[kLayerScales], shares_, half_, joined_;
  Buffer<float> embedding_[kLayerScales];
};

void LayersBand::filter(const Progress& progress) {
  const int height = rows_.end - rows_.begin;
  results_.clear();
  for (int l = 0; l < layers(); ++l) results_.emplace_back(kLayerPlanes * size_t(height) * size_t(width_), 0.0f);
  const std::vector<Window> tiles = tilesOf(height, width_, tile_);
  std::atomic<size_t> filtered = 0;
  Done done(double(std::max<size_t>(tiles.size(), 1)), progress);
  parallelFor(0, int(tiles.size()), [&](int i) {
    if (progress.stop.stop_requested()) throw Cancelled();
    Window tile = tiles[size_t(i)];
    tile.y += rows_.begin;
    TileFilter one(*this, tile);
    for (int l = 0; l < layers(); ++l) filtered += one.run(l);
    done.add(1);
  });
  filtered_ = filtered;
  skipped_ = tiles.size() * size_t(layers()) - filtered;
}

}  // namespace fathom::nn
