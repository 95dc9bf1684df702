// The numbers of `fathom compare` for two pictures that are open.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "flat/metrics.h"
#include "gui/picture.h"

namespace fathom::gui {

struct ComparedPart {
  std::string name;  // "flattened", "per bin", "in front of 3.5", "behind 3.5"
  double relMse = 0, mse = 0;
  // Those that are not measured per bin.
  std::optional<double> relMseTrimmed, psnr, smape, ssim;
};

struct ComparedNumbers {
  std::vector<ComparedPart> parts;  // the flattened images first
  std::vector<std::string> notes;   // lines for the user: what was left out, and why
};

// How far `image` is from `reference`. Two deep images with the same bins are compared per bin, too, and in front of and
// behind each of the depths `clips`; of others the flattened images are. Throws Error where data windows differ or R, G
// or B is missing, and Cancelled.
ComparedNumbers compareNumbers(const Picture& image, const Picture& reference, const std::vector<float>& clips,
                               const Progress& progress = {});

}  // namespace fathom::gui
