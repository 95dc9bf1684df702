// A render moved a little along its own noise: what Monte Carlo estimates of a denoiser's derivative are made of.
//
// Source: Ramani et al. 2008 by way of Firmino et al., "Progressive Denoising of Monte Carlo Rendered Images", equation
// 2, with bounded steps instead of normal ones: every pixel moves by its noise's standard deviation s, up or down.
// - R, G and B of a pixel move together: they are means over the same camera samples, and their noise is nearly one.
//   (Stein's lemma wants the covariance of all that the denoiser reads; signs of their own per channel miss the terms
//   between channels: on the shared renders the estimates were then up to 1.9 times the true error.)
// - Half buffers of n0 and n1 camera samples move by s (a + b sqrt(n1 / n0)) and s (a - b sqrt(n0 / n1)), with random
//   signs a and b: each has the variance of its own mean, both are uncorrelated, and the mean moves by s a.
// - diffuse.* and specular.* share the step in proportion to their variances (independent components have this
//   covariance with their sum), which keeps R = diffuse + specular.
// - albedo.* moves with the colour, by its own standard deviation times the correlation of both that half0.albedo.*
//   and half1.albedo.* show: where several surfaces share a pixel, their camera samples decide both, and a denoiser
//   that divides by the albedo and multiplies it back hands that noise on.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "flat/image.h"
#include "flat/noise.h"

namespace fathom::flat {

class Perturber {
 public:
  // Both must outlive it.
  Perturber(const Image& noisy, const Noise& noise);

  // The render with its colours, their components and half buffers moved by `size` times the step of the given seed and
  // probe. Signs depend on these and on the pixel's place in the plane of the image alone: the same for any window.
  // Pixels whose noise is not known stay.
  Image moved(uint64_t seed, int probe, float size) const;

 private:
  void findShares();
  void findAlbedo();
  void move(const std::string& half, float sign, uint64_t seed, int probe, float size, Image& image) const;

  const Image& noisy_;
  const Noise& noise_;
  // Per channel and pixel, the diffuse component's part of the variance; empty where there are no components.
  std::array<Buffer<float>, 3> diffuse_;
  // Per channel and pixel, how far the albedo moves with a standard deviation of the colour; empty where no halves
  // tell.
  std::array<Buffer<float>, 3> albedo_;
};

}  // namespace fathom::flat
