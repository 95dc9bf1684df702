// The mixing network: from what is known of candidates for a frame to how much each of them counts.
//
// Source: nn/train/mix_model.py. Candidates share the weights, and each also sees how it differs from their mean; what comes of
// it is averaged into a context, so that their order and number do not matter.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "base/buffer.h"
#include "base/progress.h"
#include "nn/module.h"
#include "nn/planes.h"
#include "nn/weights.h"

namespace fathom::nn {

constexpr int kMixOwn = 10, kMixShared = 12;  // planes of a candidate and of the frame

// What the network sees of a window, whose sides are multiples of 4 and may go beyond the frame's right and lower edges by up to
// 3 pixels, where the last column and row are repeated. Called from many threads at once. Values are finite.
struct MixSource {
  int candidates = 0, height = 0, width = 0;
  std::function<void(const Window& window, const Planes& to)> shared;              // kMixShared planes
  std::function<void(int candidate, const Window& window, const Planes& to)> own;  // kMixOwn
};

// Of each pixel of the frame; all are 0 for a network that has learned nothing.
struct MixLogits {
  std::vector<Buffer<float>> weight;  // of each candidate
  Buffer<float> share;                // of the candidates together, against the render
};

class MixNet {
 public:
  static constexpr int kAlignment = 4;

  // Throws an Error for files of another format or version, or with other tensors than the network's.
  explicit MixNet(const WeightFile& weights);

  // Arithmetic per pixel and candidate; what is done for borders of tiles comes on top.
  double flopPerPixel() const;
  // What one thread works in at most, beside the result.
  size_t bytesPerThread(int candidates) const;

  // In tiles of a fixed size, many at once. The same bits for any number of threads. Throws Cancelled.
  MixLogits run(const MixSource& source, const Progress& progress = {}) const;

 private:
  struct Scratch;
  void runTile(const MixSource& source, const Window& tile, Scratch& scratch, MixLogits& result) const;

  Value features_, weight_, share_;
  std::unique_ptr<const Module> unet_, head_, shareHead_;
  int halo_ = 0;
};

}  // namespace fathom::nn
