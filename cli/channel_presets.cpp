#include "cli/channel_presets.h"

#include <array>

namespace fathom::cli {

namespace {

constexpr std::array<ChannelPreset, 1> kPresets = {{
    {"arnold", R"(
# Arnold User Guide, "Light Path Expression AOVs": diffuse is C<RD>.*, diffuse_albedo is C<RD>A.
# What is not diffuse reflection (specular, coat, transmission, sss, emission, volume) is filtered as one component.
albedo = diffuse_albedo
specular = RGB - diffuse
N = N
)"},
}};

}  // namespace

std::span<const ChannelPreset> channelPresets() {
  return kPresets;
}

}  // namespace fathom::cli
