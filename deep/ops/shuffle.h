// Which channels an image has, and under which names.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

// Names may hold one '*', which stands for any characters: "Z*", "diffuse.*".
bool matches(std::string_view pattern, std::string_view name);

struct ChannelCopy {
  std::string to, from;  // both with a '*' or both without: "*" from "diffuse.*" copies every channel of the layer
};

struct ChannelConstant {
  std::string name;
  double value;
};

struct Shuffle {
  std::vector<ChannelCopy> map = {};
  std::vector<std::string> keep = {};  // empty: all
  std::vector<std::string> drop = {};
  std::vector<ChannelConstant> set = {};
};

// First the copies, all from the channels as they were, so that two may change places; what they are copied to keeps
// the type of the source. Then what `keep` does not name goes, then what `drop` names. Then constants: the channel keeps
// its type, a new one is FLOAT; in one that is HALF the value is rounded. Values pass bit for bit. A and Z may go, too:
// such an image can be written but not composited. Halo 0.
//
// Throws Error, with the name, where a channel to copy is missing, where keep or drop name one without '*' that there is
// not, where the copies' stars do not match or two go to one channel, where A, Z or ZBack would become UINT, and where a
// UINT channel is set to something that is no whole number from 0 to 2^32 - 1.
DeepImage shuffle(DeepImage image, const Shuffle& how);

}  // namespace fathom::deep
