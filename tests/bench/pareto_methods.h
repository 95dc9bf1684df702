// Every method and setting of the denoiser, as the program runs them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/denoise_plan.h"
#include "cli/denoise_setting.h"
#include "deep/image.h"
#include "flat/image.h"

namespace fathom::bench {

struct Method {
  std::string name;
  cli::DenoiseSetting setting;
  bool plainGuides =
      false;  // flat, Open Image Denoise: its best network with guides that are not denoised first, which
              // no option of the program gives
};

// Those with Open Image Denoise only where its library is found, those with the network only where a model is installed; in
// bfloat16 (`fast`) only where the processor has it.
std::vector<Method> paretoMethods();

// A file as a method's plan has it.
struct Prepared {
  cli::FrameInputs inputs;
  cli::SequencePlan plan;
  deep::DeepImage image;  // decoded; a flat file's pixels are opaque bins
};

// `scratch`: a folder that can be written to; nothing is.
Prepared prepare(const Method& method, const std::string& path, const std::string& scratch);

deep::DeepImage denoised(const Prepared& prepared, deep::DeepImage image);

// The flat image of what was denoised, or was to be.
flat::Image flattened(const Prepared& prepared, const deep::DeepImage& image);

}  // namespace fathom::bench
