#include "nn/layers_band.h"

#include <algorithm>
#include <stdexcept>

#include "base/parallel.h"

namespace fathom::nn {

namespace {

Interval clipped(const Interval& rows, int height) {
  return {std::max(rows.begin, 0), std::min(rows.end, height)};
}

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

// `whole`: of the frame.
void LayersBand::contextTile(const Window& whole) {
  // Results are made from contexts within filterHalo, and are 0 farther than that from samples.
  const Window tile = near(whole, 2 * net_.filterHalo(), height_, width_, LayersNet::kAlignment, [&](int x, int y) {
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
      for (size_t c = 0; light.divided() && c < 3; ++c) {
        const float by = w * (row.plane(kAlbedoInput + c)[s] + kLeastAlbedo);
        to[(kSplatted + c) * plane] += by;
        to[(kSplatted + 3 + c) * plane] += by * row.exposed(light.light, c, s);
      }
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
