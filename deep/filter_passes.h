// Which candidate filters the denoiser has, pass by pass: its own, or those of a paper that it is compared with.
//
// Own: the bank of Vicini et al. (Paper, below), changed. On the shared renders patches of 7x7 have a quarter less error,
// and a third candidate as careful about features as the first 8 % less, 15 % per bin. The second pass of `best` is ours
// (the idea of a pilot estimate is as old as NL-Means): the noisy halves filtered once more, with colour weights from the
// first pass's halves. The result is the mean of both passes, which err differently: 5 % less error than either.
//
// Paper: Vicini et al., section 4.2: (k_O, k_f) = (0.45, 0.7), (0.6, 2), (1e4, 2), all with tau 0.001, windows of 9x9 and
// patches of 3x3; errors by equation 13; the best candidate of each pixel, by a map that is smoothed. The weights, the
// variance and how errors are smoothed are those of our own filter where they depart from the paper (see joint_filter,
// guide and selection).
//
// Rdfc: Rousselle, Manzi, Zwicker 2013, "Robust Denoising using Feature and Color Information", which figure 8 of
// Vicini et al. compares with. That paper was not at hand: EVERY NUMBER OF ITS BANKS IS FROM MEMORY OF THE LITERATURE
// AND UNCHECKED, as is that its selection takes the best candidate by a binary map that is smoothed:
//   FIRST   radius 10, patch radius 1, k_c 0.45, k_f 0.6, tau 1e-3
//   SECOND  radius 10, patch radius 3, k_c 0.45, k_f 0.6, tau 1e-3
//   THIRD   radius 10, patch radius 1, k_c infinite, k_f 0.6, tau 1e-4
//   second pass: radius 10, patch radius 1, k_c 1, k_f 0.6, tau 1e-4
// Ours, not the paper's, are here the prefiltered features (those of Vicini et al.), Stein's estimate without derivatives
// (crossed weights), the width of the smoothing, and what the second pass does: it filters the noisy halves by the first
// pass's and is averaged with it, as in `best`.
#pragma once

#include <vector>

#include "deep/denoise.h"
#include "deep/joint_filter.h"
#include "deep/selection.h"

namespace fathom::deep {

// The candidates of all banks, in order, go into one selection. Banks differ in what the candidates of one share: windows,
// patches, tau.
struct FilterPass {
  std::vector<JointFilterParams> banks;
  SelectionParams selection;

  int candidates() const;
  int radius() const;       // of the largest window
  int guideBorder() const;  // that the guides need
};

// First to last. A second one needs halves: the variance of the pilot is their difference.
std::vector<FilterPass> filterPasses(const DenoisePlan& plan);

}  // namespace fathom::deep
