// Frames with references at several sample counts, deep and flat, for error against time.
//
// The files NAME.deep.exr of a folder that have a NAME.ref.exr are taken as rendered, with NAME.flat.exr beside it, else
// with what their bins come to (deep/flat_noisy). Fewer samples come from NAME.samples.exr, where there is one: 2, 4 and 8
// camera samples of each pixel, chosen without a look at them (the file is sorted by depth: its first ones would be the
// nearest), clustered anew. That is what a render of so many samples hands over, with halves, variances and counts that
// are its own. Half buffers were not taken for renders of half the samples: they would have no halves of their own, and
// so show another method.
#pragma once

#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::bench {

struct ParetoFrame {
  std::string name, set;      // set: "as rendered", "4 samples"
  std::string deep, flat;     // files
  std::string reference;      // flat
  std::string deepReference;  // with the bins of `deep`; empty: none
  double binsPerPixel = 0;
};

// By set, as rendered first, then by name. What is made goes to the folder `scratch`. Throws Error where there is none.
std::vector<ParetoFrame> findParetoFrames(const std::string& folder, const std::string& scratch);

// A file of camera samples with `count` of its fathom:spp slots in each pixel, those without a sample in them counted; which
// ones depends on the pixel alone.
deep::DeepImage someSamples(const deep::DeepImage& samples, int count);

}  // namespace fathom::bench
