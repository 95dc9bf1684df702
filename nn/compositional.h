// The compositional denoiser: a colour and its guides to the same colour without noise.
//
// Source: Fathom's network after kernel prediction with learned decomposition: a colour is split into K = 1, 2 or 4 parts
// that are easier to denoise than their sum, each is filtered with predicted kernels at three scales, and they are added
// again. Layers: nn/compositional_layers.h.
#pragma once

#include <array>
#include <memory>
#include <stop_token>
#include <string>

#include "nn/components.h"
#include "nn/compositional_layers.h"
#include "nn/kernel_filter.h"
#include "nn/module.h"
#include "nn/planes.h"
#include "nn/weights.h"

namespace fathom::nn {

constexpr int kMostComponents = 4;

// A frame or a part of it. Sides are multiples of 4 (kAlignment).
struct CompositionalInput {
  ConstPlanes planes;  // kInputPlanes of them, finite, scaled as in training
  ConstPlanes colour;  // 3, linear, finite, not negative
  int height = 0, width = 0;
};

class CompositionalNet {
 public:
  static constexpr int kAlignment = 4;

  // Throws an Error for files of another format, version or number of planes, or with other tensors than the network's.
  explicit CompositionalNet(const WeightFile& weights, Precision precision = Precision::float32);

  int width() const { return width_; }
  Element element() const { return encoder_->element(); }
  // What more components are worth to a block, as the weights' training found.
  const ComponentGains& gains() const { return gains_; }

  // Components are 1, 2 or 4 everywhere.
  // Arithmetic per pixel in the network's layers; what is done for borders comes on top.
  double flopPerPixel(int components) const;
  // The same for a window of a frame, with what is done for its borders.
  double flop(const Window& window, int height, int width, int components) const;
  // How far away an input may be that an output depends on, rounded up to kAlignment.
  int halo(int components) const;
  // What denoising holds besides its input and output, per pixel of the window with its halo.
  double bytesPerPixel(int components) const;

  // The memory that denoising works in; it grows to what the largest window needs.
  class Workspace {
   public:
    Workspace() = default;

   private:
    friend class CompositionalNet;
    struct Level {  // a colour, [3][height][width], and its features
      Buffer<float> colour;
      Buffer<std::byte> features;
    };

    Buffer<std::byte> arena, logColour;
    Level levels[3][2];
    Buffer<float> filtered[3], alpha[2];
    BorderedColour colour[3];
  };

  // Denoises a window of a frame, and fills that window of `out`, which has the frame's size and overlaps no input. The
  // result is that of the whole frame to within rounding: what the window depends on is computed around it. The window's
  // sides are multiples of kAlignment. Throws Cancelled soon after a stop is requested.
  void denoise(const CompositionalInput& frame, const Window& window, int components, const Planes& out,
               Workspace& workspace, const std::stop_token& stop = {}) const;

  // The parts, for measurements.
  const Module& encoder() const { return *encoder_; }
  const Module& decompose() const { return *decompose_; }
  const Module& denoiser() const { return *denoise_; }

 private:
  class Run;

  // What is computed for a window: colours and features of each level, and the encoder's.
  struct Windows {
    std::array<Window, 3> level;
    Window encoder;
  };
  Windows windowsFor(const Window& window, int height, int width, int depth) const;

  int width_ = 0;
  ComponentGains gains_;
  Value planes_, features_;
  DecomposeGraph decomposeValues_;  // their graphs have moved into the modules
  DenoiseGraph denoiseValues_;
  std::unique_ptr<const Module> encoder_, decompose_, denoise_;
  // Around a window, by how often a colour is still split: of the level's features and colour, and of the planes.
  std::array<int, 3> levelHalo_{}, encoderHalo_{};
};

}  // namespace fathom::nn
