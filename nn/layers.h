// The layered denoiser: samples of pixels to layers of a clean image that are composited front to back.
//
// Source: Munkberg and Hasselgren, "Neural Denoising with Layer Embeddings", sections 3 and 6, appendix A. Samples are
// reduced to embeddings; a U-net sees their means; each sample is split among the layers; what of it went into a layer is
// splatted with kernels of that layer at three scales. Departures: kernels are exp of clamped logits, without the frame's
// maximum, which would tie tiles together; a hundredth is taken off each share, so that layers can be exactly empty; what
// misses everything (alpha below 1) passes all layers; scales are joined in each layer, before compositing, so that layers
// exist at full size; diffuse and specular light are filtered apart, as pixel networks do, the diffuse one divided by the
// albedo of its sample, and what a layer becomes is multiplied by the albedo of the pixel's own samples in that layer, as
// far as the light was not brighter before it was divided.
// Graphs and the other departures: nn/layers_graphs.h.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "nn/layers_graphs.h"
#include "nn/module.h"
#include "nn/planes.h"
#include "nn/weights.h"

namespace fathom::nn {

// What diffuse light is divided by: the albedo and this. Larger than the flat network's, whose training knows the division.
constexpr float kLeastAlbedo = 0.1f;

// Planes of a row of samples: kSampleInputs inputs, as training has them, all finite; then what is splatted, R G B of the
// diffuse and of the specular light. Where the diffuse light is filtered by itself it is divided, in the inputs, too.
enum SamplePlane : size_t {
  kAlbedoInput = 6,
  kWeightInput = 16,
  kExposedAt = kSampleInputs,
  kSampleDepth = kExposedAt + 6,
  kSamplePlanes
};

// What of the samples' light the network is to see and to filter.
enum class SampleLight { Both, Diffuse, Specular };

// The samples of one row of pixels, those of pixel x being [first[x], first[x + 1]) of the planes, front to back.
// None has a weight of 0.
struct SampleRow {
  std::vector<uint32_t> first;  // of width + 1 pixels
  Buffer<float> values;         // kSamplePlanes of count() each

  size_t count() const { return first.empty() ? 0 : first.back(); }
  float* plane(size_t p) { return values.data() + p * count(); }
  const float* plane(size_t p) const { return values.data() + p * count(); }
  // Channel c of what is filtered of a sample.
  float exposed(SampleLight light, size_t c, size_t sample) const {
    const float diffuse = plane(kExposedAt + c)[sample], specular = plane(kExposedAt + 3 + c)[sample];
    return light == SampleLight::Both ? diffuse + specular : light == SampleLight::Diffuse ? diffuse : specular;
  }
};

class LayersNet {
 public:
  static constexpr int kAlignment = 4;

  // Throws an Error for files of another format, version, embedding or number of inputs, or with other tensors.
  explicit LayersNet(const WeightFile& weights, Precision precision = Precision::float32);

  int width() const { return width_; }
  Element element() const { return context_->element(); }
  int block() const { return context_->sizes().block; }

  // Arithmetic per pixel of so many samples in the network's layers and filters, of both lights at once or of two apart;
  // borders come on top.
  double flopPerPixel(double samples, int layers, int lights = 1) const;
  // How far away samples may be that a result depends on; and those that are splatted into it.
  int halo() const { return meanHalo_ + filterHalo_; }
  int filterHalo() const { return filterHalo_; }
  // Beyond that of the filter: what the U-net sees, and what tells whether it must look at all (nn/layers_band).
  int contextHalo() const { return contextHalo_; }
  int meanHalo() const { return meanHalo_; }
  // What a band of one or two lights holds per pixel, its results included; and what is worked in per pixel of a tile
  // with its halo.
  double bandBytes(int layers, int lights) const;
  double tileBytes() const;

  const Module& embed() const { return *embed_; }
  const Module& partition() const { return *partition_; }
  const Module& context() const { return *context_; }
  const Module& kernel(int scale) const { return *kernel_[scale]; }
  const EmbedGraph& embedValues() const { return embedValues_; }
  const PartitionGraph& partitionValues() const { return partitionValues_; }
  const ContextGraph& contextValues() const { return contextValues_; }
  const KernelGraph& kernelValues(int scale) const { return kernelValues_[scale]; }

 private:
  int width_ = 0, contextHalo_ = 0, meanHalo_ = 0, filterHalo_ = 0;
  EmbedGraph embedValues_;  // their graphs have moved into the modules
  PartitionGraph partitionValues_;
  ContextGraph contextValues_;
  KernelGraph kernelValues_[kLayerScales];
  std::unique_ptr<const Module> embed_, partition_, context_, kernel_[kLayerScales];
};

}  // namespace fathom::nn
