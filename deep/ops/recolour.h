// Recolouring: the colour of a flat image, given to the samples of a deep one.
#pragma once

#include <string>
#include <vector>

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

struct RecolourParams {
  std::vector<std::string> channels{"R", "G", "B"};  // of the flat image, or layers of it; premultiplied
  bool matte = false;                                // alphas, too, become such that they flatten to the flat A
};

// The deep image with samples whose colours flatten to those of `flat`, whatever they were: in each pixel, a sample's
// colour is the flat one times the sample's part of the pixel's alpha, its own alpha / the flattened alpha. Pixels of
// `flat` are found by their coordinates; where it has none, it is 0. Where a pixel's samples have no alpha at all, each
// gets the same part. A pixel without samples stays empty, and the flat colour there is lost: see countUncovered.
//
// With `matte`, the optical depth u = -log(1 - alpha) of each sample is scaled by that of the flat alpha / that of the
// deep one, where an alpha of 1 counts as the largest below it, 1 - 2^-24: so a pixel that becomes opaque does not end
// at its first sample, and in one that no longer is, what is opaque gives way more than what is not. Where both are the
// same, alphas stay bit for bit. Samples without alpha get the same part each where a pixel has no other, and none
// otherwise. Premultiplied channels that are not recoloured follow their sample's alpha.
//
// Depths, ids and all else pass bit for bit; channels that the deep image lacks are added. Samples may lie in any
// order and overlap. Alphas count as opacity() has them; flat values that are not finite count as 0. Left out, since
// they say nothing of the new values: variances and half buffers of what is recoloured, and with `matte` all of them,
// sample counts and the attribute fathom:spp. Halo 0. Throws Error when A is missing in `deep`, or in `flat` with
// `matte`; when `flat` has not all of `channels`; when one of them is A, Z or of another kind that is not
// premultiplied, or UINT in `deep`.
DeepImage recolour(DeepImage deep, const flat::Image& flat, const RecolourParams& params);

// In how many pixels of each row of the deep image's data window `flat` has an alpha or a colour, but there is no
// sample to carry it.
std::vector<size_t> countUncovered(const DeepImage& deep, const flat::Image& flat, const RecolourParams& params);

}  // namespace fathom::deep
