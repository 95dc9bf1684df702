// Clipping: what lies between two depths.
#pragma once

#include <string_view>

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// The samples in the half-open range [near, far), which may reach to infinity and is empty where near >= far; volumes
// that reach beyond it are cut, so that the part in front of a depth over the part behind it is the whole. Samples that
// are not cut pass bit for bit, in their order; where one is cut, the channels that describe its camera samples (half
// buffers, variances, counts) are void and left out of the result. A point at infinity, which a depth that is no number
// counts as, is behind every plane. Throws Error when A or Z is missing. Halo 0.
DeepImage clip(const DeepImage& image, float near, float far);

// Whether `clip` cuts a volume of the image: what decides about statistics where an image comes in bands.
bool clipCuts(const DeepImage& image, float near, float far);

enum class Side { Front, Behind };

// The same with a plane of its own for every pixel: what lies in front of the depth in `channel` of `map`, or from there
// on. Pixels outside of the map's window, and those where it is no number, pass as they are. Statistics are left out
// wherever the image has ZBack. Throws Error, too, where the map has no such channel. Halo 0.
DeepImage clipByMap(const DeepImage& image, const flat::Image& map, std::string_view channel, Side keep);

}  // namespace fathom::deep
