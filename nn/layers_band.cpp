#include "nn/layers_band.h"

#include <algorithm>
#include <atomic>
#include <stdexcept>

#include "base/parallel.h"
#include "nn/kernel_filter.h"

namespace fathom::nn {

namespace {

Interval clipped(const Interval& rows, int height) {
  return {std::max(rows.begin, 0), std::min(rows.end, height)};
}

Window scaled(const Window& window, int scale) {
  return {window.x >> scale, window.y >> scale, window.width >> scale, window.height >> scale};
}

constexpr float kAround = 0.125f;  // the weight of the divisor around a pixel beside that of its own samples
constexpr float kTiny = 1e-12f;

// The pixels of the samples of a chunk.
std::vector<uint32_t> pixelsOf(const SampleRow& row, const SampleChunk& chunk, size_t firstPixel) {
  std::vector<uint32_t> result(chunk.count);
  size_t pixel = 0;
  for (size_t i = 0; i < chunk.count; ++i) {
    while (row.first[pixel + 1] <= chunk.begin + i) ++pixel;
    result[i] = uint32_t(firstPixel + pixel);
  }
  return result;
}

}  // namespace

LayersBand::LayersBand(const LayersNet& net, int height, int width, const Interval& rows, int layers,
                       const std::vector<SampleLight>& lights, int tile)
    : net_(net),
      height_(height),
      width_(width),
      layers_(layers),
      tile_(tile),
      rows_(rows),
      sumRows_(clipped(rows.around(net.filterHalo()), height)),
      meanRows_(clipped(sumRows_.around(net.meanHalo()), height)),
      lights_(lights.size()) {
  for (const int side : {height, width, rows.begin, rows.end})
    if (side % LayersNet::kAlignment != 0 || side < 0) throw std::logic_error("sides are multiples of 4");
  if (layers != 1 && layers != 2 && layers != 4) throw std::logic_error("layers are 1, 2 or 4");
  if (lights.empty()) throw std::logic_error("a band has a light at least");
  for (size_t i = 0; i < lights.size(); ++i) lights_[i].light = lights[i];
  const size_t pixels = size_t(meanHeight()) * size_t(width_);
  for (Light& light : lights_) light.mean = Buffer<float>(groups() * pixelFloats() * pixels, 0.0f);
  occupied_ = Buffer<uint8_t>(pixels, 0);
}

void LayersBand::addMeans(int y, const SampleRow& row) {
  const size_t firstPixel = size_t(y - meanRows_.begin) * size_t(width_);
  for (size_t x = 0; x + 1 < row.first.size(); ++x) occupied_[firstPixel + x] = row.first[x + 1] > row.first[x];
  const size_t groupFloats = pixelFloats() * size_t(meanHeight()) * size_t(width_);
  for (Light& light : lights_)
    embedRow(net_, row, light.light, [&](const SampleChunk& chunk) {
      const std::vector<uint32_t> pixels = pixelsOf(row, chunk, firstPixel);
      addWeighted(chunk.embedding, chunk.groupFloats, int(groups()), net_.block(),
                  row.plane(kWeightInput) + chunk.begin, pixels.data(), chunk.count, light.mean.data(), groupFloats);
    });
}

template <class There>
Window LayersBand::near(const Window& tile, int reach, const There& there) const {
  const Window around = grown(tile, reach, height_, width_);
  int x0 = around.x + around.width, y0 = around.y + around.height, x1 = around.x, y1 = around.y;
  for (int y = around.y; y < around.y + around.height; ++y) {
    int first = around.x, last = around.x + around.width;
    while (first < last && !there(first, y)) ++first;
    if (first == last) continue;
    while (!there(last - 1, y)) --last;
    x0 = std::min(x0, first), x1 = std::max(x1, last);
    y0 = std::min(y0, y), y1 = y + 1;
  }
  if (x0 >= x1) return {};
  constexpr int kStep = LayersNet::kAlignment;
  x0 = std::max(tile.x, (x0 - reach) / kStep * kStep), y0 = std::max(tile.y, (y0 - reach) / kStep * kStep);
  x1 = std::min(tile.x + tile.width, (x1 + reach + kStep - 1) / kStep * kStep);
  y1 = std::min(tile.y + tile.height, (y1 + reach + kStep - 1) / kStep * kStep);
  return {x0, y0, x1 - x0, y1 - y0};
}

// `whole`: of the frame.
void LayersBand::contextTile(const Window& whole) {
  // Results are made from contexts within filterHalo, and are 0 farther than that from samples.
  const Window tile = near(whole, 2 * net_.filterHalo(), [&](int x, int y) {
    return occupied_[size_t(y - meanRows_.begin) * size_t(width_) + size_t(x)] != 0;
  });
  if (area(tile) == 0) return;
  const Window from = grown(tile, net_.contextHalo(), height_, width_);
  const Window inside = {tile.x - from.x, tile.y - from.y, tile.width, tile.height};
  const size_t values = groups() * pixelFloats() * area(from);
  const auto plan = net_.context().plan(from.height, from.width);
  for (Light& light : lights_) {
    Buffer<float> mean(values);
    cropGroups(reinterpret_cast<const std::byte*>(light.mean.data()), groups(), meanHeight(), width_,
               pixelFloats() * sizeof(float), {from.x, from.y - meanRows_.begin, from.width, from.height},
               reinterpret_cast<std::byte*>(mean.data()));
    Buffer<std::byte> input(values * bytesOf(net_.element()));
    toElements(mean.data(), values, net_.element(), input.data());
    mean = {};
    Buffer<std::byte> arena(plan->layout().bytes);
    const std::byte* inputs[] = {input.data()};
    plan->run(inputs, arena.data());
    const auto take = [&](Value value, int scale, Buffer<std::byte>& to) {
      pasteGroups(Plan::result(*plan, arena.data(), value), groups(), from.height >> scale, from.width >> scale,
                  pixelBytes(), scaled(inside, scale), to.data(), sumHeight() >> scale, width_ >> scale,
                  tile.x >> scale, (tile.y - sumRows_.begin) >> scale);
    };
    if (&light == &lights_.front()) take(net_.contextValues().partition, 0, partition_);
    for (int i = 0; i < kLayerScales; ++i) take(net_.contextValues().kernel[i], i, light.kernel[i]);
  }
}

void LayersBand::makeContext(const Progress& progress) {
  const size_t pixels = size_t(sumHeight()) * size_t(width_);
  partition_ = Buffer<std::byte>(groups() * pixelBytes() * pixels, std::byte(0));
  for (Light& light : lights_)
    for (int i = 0; i < kLayerScales; ++i)
      light.kernel[i] = Buffer<std::byte>(groups() * pixelBytes() * (pixels >> 2 * i), std::byte(0));
  const std::vector<Window> tiles = tilesOf(sumHeight(), width_, tile_);
  Done done(double(std::max<size_t>(tiles.size(), 1)), progress);
  parallelFor(0, int(tiles.size()), [&](int i) {
    if (progress.stop.stop_requested()) throw Cancelled();
    Window tile = tiles[size_t(i)];
    tile.y += sumRows_.begin;
    contextTile(tile);
    done.add(1);
  });
  for (Light& light : lights_) {
    light.mean = {};
    light.sums.resize(size_t(layers_));
    for (Sums& sums : light.sums) {
      sums.planes = Buffer<float>(light.splatted() * pixels, 0.0f);
      std::fill_n(sums.planes.data() + 4 * pixels, pixels, 1.0f);  // what misses everything passes all layers
      sums.embedding = Buffer<float>(groups() * pixelFloats() * pixels, 0.0f);
    }
  }
}

ContextRow LayersBand::contextRow(int y) const {
  const size_t row = size_t(width_) * pixelBytes();
  return {partition_.data() + size_t(y - sumRows_.begin) * row, size_t(sumHeight()) * row};
}

float* LayersBand::sumRow(Light& light, int layer, size_t plane, int y) {
  return light.sums[size_t(layer)].planes.data() +
         (plane * size_t(sumHeight()) + size_t(y - sumRows_.begin)) * size_t(width_);
}

void LayersBand::addChunk(Light& light, int y, const SampleRow& row, const SampleChunk& chunk, const float* shares,
                          size_t stride) {
  const std::vector<uint32_t> pixels = pixelsOf(row, chunk, size_t(y - sumRows_.begin) * size_t(width_));
  const size_t plane = size_t(sumHeight()) * size_t(width_);
  std::vector<float> weight(chunk.count);
  for (int l = 0; l < layers_; ++l) {
    float* planes = light.sums[size_t(l)].planes.data();
    for (size_t i = 0; i < chunk.count; ++i) {
      const size_t s = chunk.begin + i;
      const float w = weight[i] = row.plane(kWeightInput)[s] * shares[size_t(l) * stride + i];
      float* to = planes + pixels[i];
      for (size_t c = 0; c < 3; ++c) to[c * plane] += w * row.exposed(light.light, c, s);
      to[3 * plane] += w;
      to[5 * plane] += w * row.plane(kSampleDepth)[s];
      for (size_t c = 0; light.divided() && c < kDivisors; ++c)
        to[(kSplatted + c) * plane] += w * (row.plane(kAlbedoInput + c)[s] + kLeastAlbedo);
    }
    addWeighted(chunk.embedding, chunk.groupFloats, int(groups()), net_.block(), weight.data(), pixels.data(),
                chunk.count, light.sums[size_t(l)].embedding.data(), pixelFloats() * plane);
  }
}

void LayersBand::addSums(int y, const SampleRow& row) {
  const bool several = lights_.size() > 1;
  Buffer<float> kept(several ? size_t(layers_) * row.count() : 0);
  Light& first = lights_.front();
  shareRow(net_, row, first.light, contextRow(y), layers_, [&](const SampleChunk& chunk) {
    addChunk(first, y, row, chunk, chunk.shares, chunk.shareStride);
    for (size_t l = 0; several && l < size_t(layers_); ++l)
      std::copy_n(chunk.shares + l * chunk.shareStride, chunk.count, kept.data() + l * row.count() + chunk.begin);
  });
  for (size_t i = 1; i < lights_.size(); ++i)
    embedRow(net_, row, lights_[i].light, [&](const SampleChunk& chunk) {
      addChunk(lights_[i], y, row, chunk, kept.data() + chunk.begin, row.count());
    });
  for (Light& light : lights_) finishOccupancy(light, y);
}

// What reaches a layer: all but what the layers before it hold, summed from behind, so that it is never less than its own.
void LayersBand::finishOccupancy(Light& light, int y) {
  for (int x = 0; x < width_; ++x) {
    float all = 0;
    for (int l = 0; l < layers_; ++l) all += sumRow(light, l, 3, y)[x];
    float reaching = std::max(0.0f, 1 - all);
    for (int l = layers_; l-- > 0;) sumRow(light, l, 4, y)[x] = reaching += sumRow(light, l, 3, y)[x];
  }
}

// Layers of one tile.
class LayersBand::TileFilter {
 public:
  TileFilter(LayersBand& band, const Window& tile) : band_(band), net_(band.net_), whole_(tile) {}

  // False where there is nothing in the layer.
  bool run(int layer) {
    tile_ = band_.near(whole_, net_.filterHalo(),
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

  // By the divisor of a pixel's own samples in the layer, and, beside them, what the kernels make of it.
  void multiply() {
    for (int y = tile_.y - from_.y; y < tile_.y - from_.y + tile_.height; ++y) {
      const float *weight = values_[0].row(3, y), *alpha = joined_.row(3, y);
      for (size_t c = 0; c < kDivisors; ++c) {
        const float *own = values_[0].row(kSplatted + c, y), *around = joined_.row(kLayerPlanes + c, y);
        float* light = joined_.row(c, y);
        for (int x = tile_.x - from_.x; x < tile_.x - from_.x + tile_.width; ++x)
          light[x] *= (own[x] + kAround * around[x] / std::max(alpha[x], kTiny)) / (weight[x] + kAround);
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

const float* LayersBand::row(int layer, size_t plane, int y) const {
  return results_[size_t(layer)].data() +
         (plane * size_t(rows_.end - rows_.begin) + size_t(y - rows_.begin)) * size_t(width_);
}

Buffer<float> LayersBand::shares(int y, const SampleRow& row) const {
  Buffer<float> result(size_t(layers()) * row.count());
  shareRow(net_, row, lights_.front().light, contextRow(y), layers(), [&](const SampleChunk& chunk) {
    for (int l = 0; l < layers(); ++l)
      std::copy_n(chunk.shares + size_t(l) * chunk.shareStride, chunk.count,
                  result.data() + size_t(l) * row.count() + chunk.begin);
  });
  return result;
}

}  // namespace fathom::nn
