// Which flat denoiser promises the least error, without a reference.
//
// Source: flat/sure, on the middle of one frame of a sequence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "cli/base_denoiser.h"
#include "flat/image.h"

namespace fathom::cli {

inline constexpr int kSampleSide = 384;  // of the middle of a frame that is looked at, pixels

// The middle of a window, of kSampleSide pixels a side or what there is.
Box middleOf(const Box& window);

// The expected squared error of a denoiser, relative to what it makes of a picture of mean colour `level`, summed. Throws
// Error where the picture says nothing of its noise.
double expectedError(const flat::Image& noisy, const flat::Denoiser& denoise, float level);

// What the choice is bound to.
struct MethodLimits {
  size_t scratch = 0;           // see makeBase
  bool keepComponents = false;  // not Open Image Denoise, which drops them
  size_t pixels = 0;            // of a whole frame, for which a denoiser may take `room` bytes
  size_t room = SIZE_MAX;
};

// The same of a base that is named in `options`, with the quality of `plan`; infinite where it does not fit `limits`.
double expectedErrorOf(const BaseOptions& options, const flat::Image& noisy, const deep::DenoisePlan& plan,
                       const MethodLimits& limits);

struct MethodChoice {
  std::string name;  // nlm, neural or oidn
  std::string why;   // for the user
};

// Of our own filter, the network where a model is named or installed, and Open Image Denoise where it is found. Our own
// where the middle of the frame, `noisy`, says nothing of its noise. `plan`: that of the frame. Throws Error where the
// model cannot be read.
MethodChoice chooseMethod(const BaseOptions& options, const flat::Image& noisy, const deep::DenoisePlan& plan,
                          const MethodLimits& limits);

}  // namespace fathom::cli
