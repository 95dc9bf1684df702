// What the compositional network sees of a frame: 24 planes, and the colour that it filters.
//
// Source: Fathom's own; nn/train/planes.py makes the same for training. Light is brought to one exposure first, so that a
// frame twice as bright is denoised alike. Diffuse light is divided by the albedo, where that is given, plus kLeastAlbedo
// (Bako et al. 2017, section 4): textures are in the albedo already, and what falls on a surface varies less.
//
//   0-2    log(1 + c), c the exposed colour of the light that is denoised, divided as above
//   3-8    albedo R, G, B and normal X, Y, Z
//   9, 10  depth z / (z + its mean where something was hit), and alpha
//   11     log(1 + the relative deviation of c), at most that of 8
//   12-14  the deviations of albedo and normal, and of depth relative to it, at most 1
//   15     as 11 of the half buffers' difference; without half buffers 1.6 deviations stand for it
//   16-18  log(1 + the rest of the light)
//   19-22  1 where albedo, normal, depth and variance are given
//   23     1 for diffuse light, -1 for specular light, 0 for the whole
#pragma once

#include <array>
#include <string>

#include "base/buffer.h"
#include "flat/image.h"
#include "nn/compositional.h"

namespace fathom::flat {

enum class Light { Whole, Diffuse, Specular };

inline constexpr float kLeastAlbedo = 0.02f;

// "", "diffuse." or "specular.": what the channels of the light begin with.
std::string prefixOf(Light light);

// Whether an image has the R, G and B of the light.
bool hasLight(const Image& image, Light light);

// The factor that brings the geometric mean of the luminances of 8x8 blocks to 0.2; blocks without light do not count, and
// the darkest ones count as a thousandth of the mean (of all but the absurd, see flat/level). 1 for a black frame.
float exposureOf(const Image& image);

// The planes of one image, of one light at a time. Values that are not finite count as 0.
class NeuralPlanes {
 public:
  // The image has the channels of DATA.md, R, G and B at least, and outlives this.
  explicit NeuralPlanes(const Image& image);

  // Of a light that the image has.
  void select(Light light);
  // Sides are filled up to multiples of 4 by repeating the last column and row. Valid until the next selection.
  nn::CompositionalInput input() const;

  // What turns a colour of the selected light, out of the network, into light of the frame.
  float restoring(size_t c, int y, int x) const { return divisor(c, y, x) / exposure_; }

  float exposure() const { return exposure_; }
  int height() const { return height_; }
  int width() const { return width_; }

 private:
  float* row(size_t plane, int y) { return planes_.data() + (plane * size_t(height_) + size_t(y)) * size_t(width_); }
  float* colourRow(size_t c, int y) { return colour_.data() + (c * size_t(height_) + size_t(y)) * size_t(width_); }
  float divisor(size_t c, int y, int x) const;
  void fillFeatures();
  void fillConstant(size_t plane, float value);
  void fillRest(float* first, size_t planes) const;

  const Image& image_;
  float exposure_;
  bool divided_ = false;  // the selected light, by the albedo
  int height_, width_;
  Buffer<float> planes_, colour_;
};

}  // namespace fathom::flat
