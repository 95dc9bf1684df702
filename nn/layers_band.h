// A band of rows of a frame on its way through the layered denoiser. What is held does not depend on how many samples
// there are: they are read twice.
#pragma once

#include <vector>

#include "base/progress.h"
#include "nn/layers.h"
#include "nn/layers_kernel.h"
#include "nn/layers_rows.h"
#include "nn/tile_work.h"

namespace fathom::nn {

// In this order: addMeans for the rows meanRows(), makeContext, addSums for the rows sumRows(), filter, then the results.
// Rows that are never added have no samples. The results are those of the whole frame to within rounding, and the same bits
// for any number of threads.
class LayersBand {
 public:
  // Rows [rows.begin, rows.end) of a frame of height x width, all multiples of LayersNet::kAlignment; `layers` is 1, 2 or 4;
  // tiles have at most `tile` pixels a side. Lights go through the network apart, in the layers that the first one makes:
  // their colours are added, and what a layer covers is the mean. The net must outlive this.
  LayersBand(const LayersNet& net, int height, int width, const Interval& rows, int layers,
             const std::vector<SampleLight>& lights, int tile);

  const Interval& rows() const { return rows_; }
  const Interval& meanRows() const { return meanRows_; }
  const Interval& sumRows() const { return sumRows_; }
  int layers() const { return layers_; }

  // Different rows may be added from many threads at once. A row may have fewer pixels than the frame.
  void addMeans(int y, const SampleRow& row);
  void makeContext(const Progress& progress = {});
  void addSums(int y, const SampleRow& row);
  void filter(const Progress& progress = {});

  // Row y of rows(), kLayerPlanes planes a layer: premultiplied in the exposure of the samples.
  const float* row(int layer, size_t plane, int y) const;
  // The parts of a row's samples in the layers, [layers][row.count()], after makeContext; y is among sumRows().
  Buffer<float> shares(int y, const SampleRow& row) const;

  // How many tiles went through the filter, by layer, and how many had nothing in them.
  size_t filtered() const { return filtered_; }
  size_t skipped() const { return skipped_; }

 private:
  struct Sums {
    Buffer<float> planes, embedding;  // [splatted][rows][width], [groups][rows][width][block]
  };
  struct Light {
    SampleLight light = SampleLight::Both;
    Buffer<float> mean;                      // [groups][mean rows][width][block]
    Buffer<std::byte> kernel[kLayerScales];  // contexts, [groups][sum rows >> scale][width >> scale][block]
    std::vector<Sums> sums;                  // of each layer

    bool divided() const { return light == SampleLight::Diffuse; }
    size_t splatted() const { return kSplatted + (divided() ? kDivision : 0); }
    size_t made() const { return kLayerPlanes + (divided() ? kDivision : 0); }
  };

  class TileFilter;

  size_t groups() const { return size_t(kEmbedding / net_.block()); }
  size_t pixelFloats() const { return size_t(net_.block()); }
  size_t pixelBytes() const { return pixelFloats() * bytesOf(net_.element()); }
  int sumHeight() const { return sumRows_.end - sumRows_.begin; }
  int meanHeight() const { return meanRows_.end - meanRows_.begin; }
  ContextRow contextRow(int y) const;
  float* sumRow(Light& light, int layer, size_t plane, int y);
  void contextTile(const Window& tile);
  // A chunk of row y into all layers, `shares` apart by `stride`.
  void addChunk(Light& light, int y, const SampleRow& row, const SampleChunk& chunk, const float* shares,
                size_t stride);
  void finishOccupancy(Light& light, int y);

  const LayersNet& net_;
  int height_, width_, layers_, tile_;
  Interval rows_, sumRows_, meanRows_;
  Buffer<uint8_t> occupied_;     // [mean rows][width]
  Buffer<std::byte> partition_;  // as contexts are, of the first light
  std::vector<Light> lights_;
  std::vector<Buffer<float>> results_;  // of each layer, [kLayerPlanes][rows][width]
  size_t filtered_ = 0, skipped_ = 0;
};

}  // namespace fathom::nn
