// Clustering: the samples of a render, one by one, become bins with the statistics that the denoiser reads.
#pragma once

#include "deep/bin_layout.h"
#include "deep/image.h"

namespace fathom::deep {

// Every sample goes to the bin of its pixel that is nearest in depth. Of each bin come out, as the channel convention
// has them:
//  - the means of all channels, premultiplied by the bin's A where they were premultiplied; ids: that of the largest
//  share;
//  - variance.* of the mean for R G B, diffuse, specular, albedo, N (not premultiplied) and Z; 0 where one sample tells
//  nothing;
//  - half0.*, half1.* for R G B, diffuse, specular and albedo, the means over a random half of the camera samples each;
//  - samples, half0.samples, half1.samples.
// Where the samples of a pixel all have the same effective alpha, 1/n, each is one of n camera samples (n: attribute
// fathom:spp, or told from the alphas): means are plain, and effective alphas of the bins are counts/n. Other samples
// count by effective alpha within their bin, and the bin's A is that of its samples composited. Colour without alpha is
// kept. Results end at 1e15: a variance of light without alpha, not premultiplied, may be beyond. A layout with alphas gives A. Bins without samples have A 0 (or the layout's) and no colour. A sample with a
// non-finite value has no say in any mean or half, but keeps its part in A and `samples`. Samples of a pixel where the
// layout has no bin are lost. Z is the layout's depth. Where a bin holds volumes, Z to ZBack is their extent, up to
// halfway to the next bin. Samples may lie in any order. Throws Error when A or Z is missing, or when the samples are
// bins already (statistics in them).
DeepImage cluster(const DeepImage& samples, const BinLayout& layout);

}  // namespace fathom::deep
