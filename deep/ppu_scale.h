// The scale that turns gaps in depth into pixels.
#pragma once

#include "deep/attributes.h"
#include "flat/box.h"

namespace fathom::deep {

// The size in pixels of a one-unit quad one unit from the camera, from the first of these that the attributes hold:
// `fathom:ppuScale`; the standard matrices `worldToCamera` and `worldToNDC` together; a horizontal field of view in
// degrees (`fieldOfView`, `fieldOfViewHorizontal`, or V-Ray's `cameraFov`) across the display window. Throws Error,
// saying how to give it, where there is none or its value is of no use.
float findPpuScale(const Attributes& attributes, const Box& displayWindow);

}  // namespace fathom::deep
