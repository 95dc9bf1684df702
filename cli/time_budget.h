// What every setting of the denoiser costs and what error it leaves, and which of them fits a time.
//
// Source: a measurement (`./run bench pareto`), whose figures are kept here; they are brought to another machine by the
// ratio of one calibration (cli/calibration) there to that of the measurement.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "cli/denoise_setting.h"

namespace fathom::cli {

// What the denoiser has to do for a frame.
struct Workload {
  double megapixels = 1;
  double binsPerPixel = 1;  // the mean over all pixels
  bool components = true;   // diffuse and specular are filtered one by one
  int runs = 1;             // of the denoiser: an estimate of its errors takes further ones
  int flatRuns = 1;         // the same of Fathom's own filter on flat frames, which may tell its errors by itself
  double networkWork = 1;   // the arithmetic of the network that is at hand over that of `small`
  bool bfloat16 = true;     // it multiplies in bfloat16 for Quality::Fast, and as a guide
};

// Seconds on the machine of the measurement, frames decoded and with all features.
struct SettingCost {
  DenoiseSetting setting;
  double perMegapixel = 0, perMillionBins = 0;  // of Fathom's own filters
  double network =
      0;  // of Open Image Denoise or a network as wide as `small`, per megapixel; of flat frames of one light
  double error =
      0;  // relMSE over that of the noisy frames: flattened, and of deep ones the geometric mean with per bin
};

// Of all settings, deep and flat ones.
std::span<const SettingCost> measuredCosts();

// The seconds of calibrationSeconds() where they were measured.
double measuredCalibration();

// Those of measuredCosts() for frames of a kind and for these guides or bases (as in DenoiseSetting::with); a guide from a
// file costs what none does.
std::vector<SettingCost> costsOf(bool deep, std::span<const std::string> with);

// On a machine that takes `slowness` times as long as that of the measurement. Linear in bins per pixel.
double expectedSeconds(const SettingCost& cost, const Workload& workload, double slowness);

struct BudgetChoice {
  DenoiseSetting setting;
  double seconds = 0;  // expected
  bool fits = true;
};

// The setting with the least error of those that are expected to take at most `budget` seconds (of equals the quicker);
// where none does, the quickest. `costs` is not empty.
BudgetChoice chooseSetting(std::span<const SettingCost> costs, const Workload& workload, double budget,
                           double slowness);

}  // namespace fathom::cli
