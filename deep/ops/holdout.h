// Holding out: what is seen of one deep image behind and within another.
#pragma once

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// The samples of `image`, attenuated by what stands in front of them in `holdout`, so that flattened they give exactly
// what is seen of `image` in the merge of both: flatten(holdout(a, b)) + flatten(holdout(b, a)) = flatten(merge({a,
// b})), for colours and alpha alike. That holds for the samples up to each depth at which one of them begins or ends,
// too: alphas are those of the light that is seen, not of the samples before. (Inside of a volume that is held out,
// light comes in as from any volume of its alpha.)
//
// Volumes of `image` are cut where samples of `holdout` begin, end or stand, so that within a common range both
// extinguish; samples of `image` that overlap each other are split and merged as `tidy` does, but only in pixels where
// `holdout` has anything to hide them. Things at the same depth share what is seen there as `tidy` merges them: of two
// opaque ones half of each. What is hidden wholly is removed; what nothing of `holdout` stands in front of or within
// passes bit for bit. Emission (alpha 0) is attenuated as other light, and hides nothing.
//
// Window, attributes and channels are those of `image`, without statistics and half buffers and fathom:spp, which are
// void for what is partly hidden; `holdout` is read for A, Z and ZBack only, and is empty outside of its data window.
// Alphas, depths and values of no use count as in `flatten`. Throws Error where either has no A or no Z, and where
// volumes overlap too much (see `tidy`). Halo 0.
DeepImage holdout(DeepImage image, const DeepImage& holdout);

// The samples of `image` that begin at a depth where the accumulated alpha of what stands in front in `holdout` is less
// than `opaque`, in (0,1]; all channels bit for bit. What `holdout` has at the same depth is not in front. With 1 only
// what is hidden wholly is removed. Throws Error as above, and for other values of `opaque`. Halo 0.
DeepImage hardHoldout(const DeepImage& image, const DeepImage& holdout, double opaque);

// What part of the alpha of `image` is seen past `holdout`, 1 where it has none: a flat image of the channel A over the
// window of `image`. Halo 0.
flat::Image holdoutMatte(const DeepImage& image, const DeepImage& holdout);

}  // namespace fathom::deep
