// Plus: the light of one image added to another.
#pragma once

#include "deep/image.h"

namespace fathom::deep {

// The light of an image without its opacity: alphas are 0 and hide nothing, and every premultiplied value is what is
// seen of it past the image's own samples, so that flattened it gives the same light. Volumes that overlap are split
// and merged as `tidy` does; what is hidden wholly is removed; emission passes with its value. Statistics and half
// buffers are left out. Throws Error when A or Z is missing, and where volumes overlap too much (see `tidy`). Halo 0.
DeepImage emission(DeepImage image);

// The samples of `image`, and the light of `added` (its emission, see above), which is attenuated by what of `image`
// stands in front. Flattened, the light of two images of which neither is in front of the other adds up, and alpha is
// that of `image`. Windows, channels and the rest are as `merge` has it. Halo 0.
DeepImage plus(DeepImage image, DeepImage added);

}  // namespace fathom::deep
