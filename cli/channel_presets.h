// Channel maps for renderers whose channel names are documented; each names its source.
#pragma once

#include <span>
#include <string_view>

namespace fathom::cli {

struct ChannelPreset {
  std::string_view name;
  std::string_view text;  // see cli/channel_map.h
};

std::span<const ChannelPreset> channelPresets();

}  // namespace fathom::cli
