// Compression: the few samples that look like all of them.
#pragma once

#include "deep/image.h"

namespace fathom::deep {

struct CompressParams {
  // How far from the truth may be, at any depth, what passes to it, of 1, and the colour in front of it, of the pixel's
  // brightest of R, G and B. Above 0. A thousandth is a quarter of a step of an 8 bit picture.
  double error = 0.001;
};

// The image with samples that follow each other put into one, as many as the error allows: a volume over all of their
// depths, or a point at the depth of one of them (of a volume: its middle). Seen from the front, R, G and B and the
// transmittance are within the error at every depth, not only at those of samples; and the pixel as a whole is what it
// was, to the rounding of FLOAT. Where there is no ZBack, there are no new volumes. What nothing can be seen of, behind
// what is opaque, is gone.
//
// Samples that stay alone pass bit for bit, if their depths are usable; the others are first made tidy, as flattening
// does it. All premultiplied channels are composited into the new samples, but R, G and B alone (0 where missing) are
// held to the error; the id is that of the sample with the largest part of its alpha. Statistics and half buffers are
// left out, always. Three things are outside of the error: overlapping volumes whose alpha together rounds to 1, which
// are opaque from their front on; light behind samples that let less than a ten-thousandth pass, which is off by what a
// step of the FLOAT alpha of the one that they become is of that; and what a file rounds where alpha or colours are HALF. Halo 0. Throws Error when A
// or Z is missing, when R, G or B is UINT, when the error is not above 0, and where volumes overlap too much (see
// `tidy`).
DeepImage compress(DeepImage image, const CompressParams& params);

}  // namespace fathom::deep
