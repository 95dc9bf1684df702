// What a channel means when samples are composited, merged or split; the name decides, as docs/channels.md has it.
#pragma once

#include <string_view>

#include "deep/image.h"

namespace fathom::deep {

enum class Role {
  Depth,          // Z, ZBack
  Alpha,          // A
  Premultiplied,  // composited with `over`: colours, components, features, and every name not listed here
  Plain,          // a coordinate of the sample, not premultiplied: averaged. coc, lens.*, time
  Half,           // half0.*, half1.*: premultiplied means over a part of the sample's own camera samples
  Statistic,      // variance.*, samples, half0.samples, half1.samples: composited nowhere
  Identifier,     // type UINT, whatever its name
};

Role roleOf(std::string_view name, PixelType type);
inline Role roleOf(const Channel& channel) {
  return roleOf(channel.name, channel.type);
}

// True for what describes the camera samples of one sample or bin, and is void once that is merged with another or
// split.
inline bool describesSamples(Role role) {
  return role == Role::Half || role == Role::Statistic;
}

// Whether samples are camera samples or bins made of them (attribute fathom:spp, or channels of statistics): their alphas
// count rays, so points at the same depth are composited one after the other and never merged.
bool holdsStatistics(const DeepImage& image);

// How many samples hold a premultiplied value that compositing takes for 0 (see finiteOrZero).
size_t countNonFinite(const DeepImage& image);

}  // namespace fathom::deep
