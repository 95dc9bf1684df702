// Channel maps: how the channels of another renderer become those of Fathom's convention.
//
// One line per layer or channel, ours = theirs; everything after a # is a comment:
//
//   albedo   = diffuse_albedo          a layer: three channels that end in R G B, r g b, red green blue or X Y Z
//   specular = RGB - diffuse           sums and differences, blanks around the sign; RGB is the layer of R, G and B
//   N        = Nworld unpremultiplied  the file's values are not multiplied with alpha: this is done on reading
//   ZBack    = Zback                   a single channel, by its full name
//
// The right side always names the channels of the file, whatever other lines make of them. A channel that is taken over
// as it is goes by our name from then on; the terms of a sum stay in the file beside it. A line of which the file has
// no channel is left out, a line of which it has a part is an error.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::cli {

struct ChannelMap {
  struct Term {
    float sign;  // 1 or -1
    std::string theirs;
  };
  struct Line {
    std::string ours;
    std::vector<Term> terms;
    bool unpremultiplied = false;
  };
  std::string name;  // the file or the preset, for messages
  std::vector<Line> lines;
};

// Throws Error with `name`, the number of the line and what was expected.
ChannelMap parseChannelMap(const std::string& name, const std::string& text);

// A preset by its name (see presetNames), or else a file.
ChannelMap readChannelMap(const std::string& presetOrFile);

std::vector<std::string> presetNames();

// One channel of ours, made of channels of the file.
struct MappedChannel {
  std::string ours;
  std::vector<ChannelMap::Term> terms;
  bool unpremultiplied = false;
};

// The map for a file with these channels. Throws Error where a line finds only a part of what it names.
std::vector<MappedChannel> resolveMap(const ChannelMap& map, std::span<const std::string> channels);

// The names after the map, in the order of the file, new ones last.
std::vector<std::string> mappedNames(std::span<const MappedChannel> map, std::span<const std::string> channels);

// Brings the image's channels under our names. Channels of the map that the image lacks (they were not read) are left
// out.
void applyMap(std::span<const MappedChannel> map, deep::DeepImage& image);

}  // namespace fathom::cli
