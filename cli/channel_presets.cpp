#include "cli/channel_presets.h"

#include <array>

namespace fathom::cli {

namespace {

// Only names that the cited documents give. None of them says how a deep sample is multiplied: they are taken to be
// premultiplied, as the beauty is. Light that no component names (emission, transmission, volumes) goes to specular,
// which is filtered without an albedo, so that nothing is lost.
constexpr std::array<ChannelPreset, 4> kPresets = {{
    {"arnold", R"(
# Arnold User Guide, "Light Path Expression AOVs" (help.autodesk.com/view/ARNOL/ENU): diffuse is C<RD>.*, diffuse_albedo
# is C<RD>A.
albedo = diffuse_albedo
specular = RGB - diffuse
)"},
    {"karma", R"(
# Houdini 21, "Karma Standard Render Vars" (www.sidefx.com/docs/houdini/nodes/lop/karmastandardrendervars.html):
# combineddiffuse is C<RD>.*L.
diffuse = combineddiffuse
specular = RGB - combineddiffuse
)"},
    {"renderman", R"(
# RenderMan 24, "Denoising" (rmanwiki.pixar.com/display/REN24/Denoising): the channels that RenderMan's own denoiser reads.
# The statistics "mse" are the error of a pixel's mean; "variance" (albedo_var, normal_var) is that of one sample: not used.
RGB = Ci
A = Ci.a
diffuse = diffuse
specular = specular
albedo = albedo
N = normal
variance = mse
variance.diffuse = diffuse_mse
variance.specular = specular_mse
variance.albedo = albedo_mse
variance.N = normal_mse
)"},
    {"vray", R"(
# V-Ray for Nuke, "Supported Render Elements" (docs.chaos.com, page 27432907): lighting and gi are the diffuse light,
# direct and indirect; what V-Ray calls diffuse is the colour of the surface.
albedo = diffuse
diffuse = lighting + gi
specular = RGB - lighting - gi
)"},
}};

}  // namespace

std::span<const ChannelPreset> channelPresets() {
  return kPresets;
}

}  // namespace fathom::cli
