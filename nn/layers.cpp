#include "nn/layers.h"

#include <algorithm>

#include "nn/kernel_filter.h"
#include "nn/layers_kernel.h"
#include "nn/metadata.h"

namespace fathom::nn {

namespace {

constexpr int kSide = 128;

int rounded(int pixels) {
  constexpr int kStep = LayersNet::kAlignment;
  return (pixels + kStep - 1) / kStep * kStep;
}

// How far the context of a tile of kAlignment pixels reaches.
int reachOf(const ContextGraph& values) {
  std::map<int, Interval> wanted = {{values.partition.index, {0, LayersNet::kAlignment}}};
  for (int i = 0; i < kLayerScales; ++i) wanted[values.kernel[i].index] = {0, LayersNet::kAlignment >> i};
  const Interval needed = values.graph.reach(wanted)[0];
  return rounded(std::max(-needed.begin, needed.end - LayersNet::kAlignment));
}

// The pixels of the smaller image that a bilinear enlargement takes `out` from.
Interval enlargedFrom(const Interval& out) {
  const auto below = [](int x) { return (x + 4096) / 2 - 2048; };  // rounds down
  return {below(out.begin - 1), below(out.end) + 1};
}

int filterReach() {
  constexpr int kTile = LayersNet::kAlignment, kReach = kKernelWidth / 2;
  Interval out = {0, kTile};
  int halo = 0;
  for (int i = 0; i < kLayerScales; ++i) {
    const Interval from = out.around(kReach);
    halo = std::max({halo, -from.begin << i, (from.end << i) - kTile});
    out = enlargedFrom(out);
  }
  return rounded(halo);
}

size_t arenaOf(const Module& module, int side) {
  return module.plan(side, side)->layout().bytes;
}

}  // namespace

LayersNet::LayersNet(const WeightFile& file, Precision precision) {
  expectMetadata(file, "format", "fathom-layers");
  expectMetadata(file, "version", "1");
  expectMetadata(file, "inputs", std::to_string(kSampleInputs));
  expectMetadata(file, "embedding", std::to_string(kEmbedding));
  width_ = widthOf(file);
  WeightSource weights(file);
  embedValues_ = embedGraph(weights);
  partitionValues_ = partitionGraph(weights);
  contextValues_ = contextGraph(weights, width_);
  for (int i = 0; i < kLayerScales; ++i) kernelValues_[i] = kernelGraph(weights, i);
  weights.finish();
  filterHalo_ = filterReach();
  contextHalo_ = reachOf(contextValues_);
  // Where nothing is splatted within twice the filter's reach, no context has a say.
  meanHalo_ = std::max(contextHalo_, 2 * filterHalo_);
  const Element element = elementFor(precision);
  const auto module = [&](Graph& graph) { return std::make_unique<Module>(std::move(graph), element); };
  embed_ = module(embedValues_.graph);
  partition_ = module(partitionValues_.graph);
  context_ = module(contextValues_.graph);
  for (int i = 0; i < kLayerScales; ++i) kernel_[i] = module(kernelValues_[i].graph);
}

double LayersNet::flopPerPixel(double samples, int layers, int lights) const {
  const double embed = embed_->graph().flopPerPixel();
  const double second = (layers > 1 ? partition_->graph().flopPerPixel() : embed) + (lights - 1) * 2 * embed;
  double pixel = context_->graph().flopPerPixel();
  for (int i = 0; i < kLayerScales; ++i)
    pixel += layers * (kernel_[i]->graph().flopPerPixel() + 2.0 * kKernelTaps * kSplatted) / (1 << 2 * i);
  const double division = lights > 1 ? 2.0 * kKernelTaps * kDivision * layers * (1 + 1 / 4.0 + 1 / 16.0) : 0;
  return samples * (embed + second) + lights * pixel + division;
}

double LayersNet::bandBytes(int layers, int lights) const {
  const double partition = double(bytesOf(element())) * kEmbedding, kernels = partition * (1 + 1 / 4.0 + 1 / 16.0);
  const double sums = layers * sizeof(float) * (kEmbedding + kMostSplatted);
  const double results = layers * sizeof(float) * kLayerPlanes;
  return lights * (sizeof(float) * kEmbedding + kernels + sums) + partition + results + 1;
}

double LayersNet::tileBytes() const {
  double work = double(arenaOf(*context_, kSide));
  double filter = 0;
  for (int i = 0; i < kLayerScales; ++i) {
    filter = std::max(filter, double(arenaOf(*kernel_[i], kSide >> i)));
    filter += double(kSide >> i) * (kSide >> i) * (2 * kEmbedding + kSplatted + 2 * kLayerPlanes + 3 * kDivision) *
              sizeof(float);
  }
  const double input = double(kSide) * kSide * kEmbedding * double(bytesOf(element()) + sizeof(float));
  work = std::max(work + input, filter);
  return work / (kSide * kSide);
}

}  // namespace fathom::nn
