// Gives a denoised frame back the light that it lacks.
//
// Source: Fathom's own. A denoiser that goes by relative errors takes light away where noise has bright tails: networks
// trained on SMAPE leave frames 1 to 3 % darker. Over all pixels that it made about as bright, the render tells how
// bright they are: its noise has a mean of 0, and averages out over thousands of pixels. So each octave of brightness
// gets a factor, linear between octaves. What an octave lacks is e max(0, 1 - 2 s^2 / e^2), e being the part of its
// light that is missing and s the standard error of that, from the residuals: nothing where noise cannot tell, or where
// a firefly that the denoiser removed is all that is missing. The brightest octaves get it first, since a little of
// theirs is much of the frame's, until the frame's light is within 0.4 % of what giving all of it back would make.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/buffer.h"
#include "flat/image.h"

namespace fathom::flat {

// Takes the brightness, a mean of R, G and B, of one pixel after the other.
class LightCurve {
 public:
  // `level`: about the mean brightness of the frame; scaled along with it, the factors stay.
  explicit LightCurve(float level) : level_(level) {}

  // Has no effect where the denoised light is not above 0, or the render not finite or absurd.
  void add(float denoised, float render);
  // What another of the same level has taken.
  void add(const LightCurve& other);
  // After the last one.
  void fit();
  // Whether any factor is not 1.
  bool changes() const { return changes_; }
  // What to multiply a pixel's colours by, 0.75 to 1.25; 1 where there is no light.
  float factor(float denoised) const;

 private:
  static constexpr int kOctaves = 20;  // below and above the level; what is beyond counts as there

  // Denoised and rendered light, and the variance of their difference.
  struct Sums {
    double pixels = 0, denoised = 0, render = 0, variance = 0;

    void add(double d, double n, double weight);
    void add(const Sums& other);
    double lacking() const;
  };
  struct Place {
    int octave = 0;
    float above = 0;  // the part that belongs to the next one
  };
  Place placeOf(float denoised) const;

  float level_;
  bool changes_ = false;
  std::array<Sums, 2 * kOctaves + 2> sums_{};
  std::array<float, 2 * kOctaves + 2> factors_{};
};

// The same of R, G and B of as many pixels: a factor for each, empty where none is to be changed. Pixels in `settled`
// (not 0) are not looked at, and keep 1. The same bits for any number of threads.
Buffer<float> lightFactors(const std::array<std::span<const float>, 3>& render, std::span<const uint8_t> settled,
                           const std::array<std::span<const float>, 3>& denoised, float level);

// Multiplies R, G and B of `denoised`, and those of its components, by these factors. Magnitudes stay at most 1e15.
void keepLight(const Image& noisy, std::span<const uint8_t> settled, Image& denoised, float level);

}  // namespace fathom::flat
