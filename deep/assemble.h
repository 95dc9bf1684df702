// Inputs in pieces: features, half buffers and better alphas that a studio keeps in files of their own, brought into
// the bins of the main image.
//
// Pixels are paired by their coordinates, samples by depth: each sample of the other image goes to the bin of the main
// image that is nearest to it (section 5.1 of the deep denoising paper), the middle of a volume standing for it. Both
// images are sorted front to back, and the main image's bins stay where they are. Values are taken without their alpha
// and multiplied with the alpha of the bin they come to.
#pragma once

#include <string_view>

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// Whether features are looked for under this name: albedo and N, their variances, variance.Z, and the albedo of halves.
bool isFeature(std::string_view channel);

// Adds the features of a deep image to the bins: the mean, weighted by effective alpha, over the samples that come to a
// bin, or the nearest sample where none does. A bin in a pixel that `features` does not have gets 0.
void addFeatures(DeepImage& image, const DeepImage& features);

// Adds the features of a flat image, whose values are means over all of a pixel's camera samples. Every bin gets the
// pixel's mean per unit of alpha (the flat image's own A, or where it has none the main image's), times its alpha. The
// variance of a bin that holds a part of the pixel's samples is so much larger.
void addFeatures(DeepImage& image, const flat::Image& features);

// Adds the colours, components and albedo of an image of the even (index 0) or odd (1) camera samples as half0.* or
// half1.*, with the number of samples that came to each bin: from the channel `samples`, or else effective alpha times
// `samplesPerPixel`.
void addHalf(DeepImage& image, const DeepImage& half, int index, double samplesPerPixel);

// Gives the bins the alphas of an image of many more camera samples: the effective alpha of a bin becomes the sum of
// those that come to it, and what is premultiplied follows. A bin that nothing comes to is empty then: alpha and
// colours 0. Pixels outside the other image's window keep theirs. Throws Error where either has no A or Z.
void replaceAlpha(DeepImage& image, const DeepImage& better);

}  // namespace fathom::deep
