// Channels from formulas over the channels of a sample.
#pragma once

#include <string>

#include "deep/image.h"

namespace fathom::deep {

struct ExpressionParams {
  std::string set;               // "R = R*0.5; A = clamp(A, 0, 1)": one or more of CHANNEL = FORMULA
  bool unpremultiplied = false;  // formulas see and give premultiplied channels, half buffers too, divided by alpha
};

// The image with channels set from formulas, one after the other, so that a later one sees what an earlier one gave. A
// channel that is not there is added as FLOAT. Formulas are muParser's, in double precision: its operators (+ - * / ^
// < <= > >= == != && || ?:) and functions, and besides those clamp(v, low, high), lerp(a, b, t), smoothstep(low, high,
// v), floor, ceil and mod(a, b). Names are channels (letters, digits, _ and dots), and x and y of the pixel, i, the
// place of the sample in its pixel from 0, and n, how many samples the pixel has; these four hide channels of such
// names.
//
// Values are read as they are, NaN and infinities included; what results as NaN or beyond 1e15 is set to 0, but Z and
// ZBack are set to it. UINT channels are read exactly, and set to the nearest whole number within [0, 2^32). With
// `unpremultiplied`, a sample without alpha (see opacity) is seen and set as it is; where A is set, all premultiplied
// channels follow it. Samples stay where they are in their pixel, whatever becomes of Z. Halo 0.
//
// Left out, unless they are set themselves: variances and half buffers of what is set; where A is set, all of them,
// sample counts and the attribute fathom:spp, which say what alphas stand for; where Z or ZBack is set, the attribute
// deepImageState. Throws Error, with the formula, the place in it and what is wrong, for what cannot be understood, and
// for `unpremultiplied` without A.
DeepImage expression(DeepImage image, const ExpressionParams& params);

}  // namespace fathom::deep
