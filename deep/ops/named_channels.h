// Channels as a user names them: one by one or by layer; and what describes a channel that an operation changes.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

// The channels that `names` stand for, each once, in the order of `names` and `available`: a name is a channel, or a
// layer, which is all channels that begin with it and a dot. Throws Error for a name that is
// neither.
std::vector<std::string> channelsNamed(std::span<const std::string> names, std::span<const std::string> available);

// The names of all channels but those of type UINT.
std::vector<std::string> floatChannels(const DeepImage& image);

// The image's channels of variances and half buffers that belong to one of `channels`, and are not in it themselves:
// they say nothing of these once their values have been changed.
std::vector<std::string> statisticsOf(const DeepImage& image, std::span<const std::string> channels);

}  // namespace fathom::deep
