// Colours for numbers: false colours, a signed scale, and a colour for every identifier. sRGB display values in [0,1].
//
// Source: the curves are ours, drawn in Oklab (Ottosson, "A perceptual color space for image processing", 2020), whose
// lightness they follow evenly: equal steps of the number are equal steps to the eye.
#pragma once

#include <array>
#include <cstdint>

namespace fathom::flat {

// At t in [0,1]: from dark violet over teal to light yellow; beyond, the colours of the ends.
std::array<float, 3> evenColour(float t);

// At t in [-1,1]: black at 0, towards light blue below and light orange above, equally bright at t and -t.
std::array<float, 3> signedColour(float t);

// The same number has the same colour everywhere, neighbours have different ones; 0, which stands for nothing, is black.
std::array<float, 3> identifierColour(uint32_t id);

}  // namespace fathom::flat
