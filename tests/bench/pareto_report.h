// What was measured of every method on every frame, as tables, pictures and the figures that a time budget works from.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tests/bench/measure.h"
#include "tests/bench/pareto_methods.h"
#include "tests/bench/plot.h"

namespace fathom::bench {

// relMSE, the reference's own error subtracted where it is known.
struct FrameErrors {
  std::string set, frame;
  double noisy = 0, denoised = 0;                 // flattened
  std::optional<double> noisyBins, denoisedBins;  // per bin
};

struct MethodResult {
  Method method;
  double secondsPerMegapixel = 0;
  std::vector<FrameErrors> errors;
};

struct ParetoResult {
  std::vector<MethodResult> methods;
  std::vector<std::string> sets;  // in the order of their tables
  double binsPerPixel = 0;        // of the deep frame that was timed
  double calibration = 0;         // seconds, see cli/calibration
  int lights = 1;                 // that the frame has apart, which the network denoises one by one
};

// Geometric means over the frames of a set that have the figure; nothing where none has.
struct MeanErrors {
  std::optional<double> flattened, bins, flattenedShare, binsShare;  // shares: of the noisy frames' error
};
MeanErrors meansOf(const MethodResult& result, const std::string& set);

// A row a method.
Table setTable(const ParetoResult& result, const std::string& set);

// A row a method and frame, numbers in full.
Table frameTable(const ParetoResult& result);

// Error of a set, flattened or per bin, against time.
Plot setPlot(const ParetoResult& result, const std::string& set, bool bins);

// The rows of the table in cli/time_budget.cpp, from the frames as rendered: costs of deep filters as a line through the
// flat one (one bin per pixel) and the deep frame that was timed; what Open Image Denoise adds apart.
std::string costRows(const ParetoResult& result);

}  // namespace fathom::bench
