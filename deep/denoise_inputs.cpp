// What of the channel convention a file offers, and what is estimated in its place.
#include <algorithm>
#include <array>

#include "deep/denoise.h"

namespace fathom::deep {

namespace {

using Names = std::span<const std::string>;

bool has(Names channels, const std::string& name) {
  return std::find(channels.begin(), channels.end(), name) != channels.end();
}

bool hasColour(Names channels, const std::string& prefix) {
  return has(channels, prefix + "R") && has(channels, prefix + "G") && has(channels, prefix + "B");
}

bool hasNormal(Names channels, const std::string& prefix) {
  return has(channels, prefix + "X") && has(channels, prefix + "Y") && has(channels, prefix + "Z");
}

bool hasHalves(Names channels, const std::string& group) {
  return hasColour(channels, "half0." + group) && hasColour(channels, "half1." + group);
}

bool startsWith(const std::string& text, std::string_view prefix) {
  return text.compare(0, prefix.size(), prefix) == 0;
}

}  // namespace

DenoiseInputs findDenoiseInputs(std::span<const std::string> channels, const Attributes& attributes) {
  DenoiseInputs in;
  in.components = hasColour(channels, "diffuse.") && hasColour(channels, "specular.");
  in.halves =
      in.components ? hasHalves(channels, "diffuse.") && hasHalves(channels, "specular.") : hasHalves(channels, "");
  if (in.components && !in.halves && hasHalves(channels, "")) {
    // Halves of the whole colour are worth more than components without a variance.
    in.components = false;
    in.halves = true;
  }
  in.halfCounts = in.halves && has(channels, "half0.samples") && has(channels, "half1.samples");
  in.albedo = hasColour(channels, "albedo.");
  in.albedoHalves = in.halves && in.albedo && hasHalves(channels, "albedo.");
  in.variance = hasColour(channels, "variance.");
  in.counts = has(channels, "samples");
  in.albedoVariance = in.albedo && hasColour(channels, "variance.albedo.");
  in.normal = hasNormal(channels, "N.");
  in.normalVariance = in.normal && hasNormal(channels, "variance.N.");
  in.depthVariance = has(channels, "variance.Z");
  in.volumes = has(channels, "ZBack");
  in.spp = attributes.getInt("fathom:spp").value_or(0);
  return in;
}

std::vector<std::string> describeMissing(const DenoiseInputs& in) {
  std::vector<std::string> lines;
  if (!in.components) lines.push_back("no diffuse.* and specular.*: the colour is filtered as one component");
  if (!in.halves)
    lines.push_back(in.variance ? "no half0.* and half1.*: the noise is taken from variance.*"
                                : "no half0.* and half1.*, no variance.*: the noise is estimated from the image");
  if (!in.albedo) lines.push_back("no albedo.*: textures are told apart by colour and depth alone");
  if (!in.normal) lines.push_back("no N.*: surfaces are told apart by colour and depth alone");
  if (in.albedo && !in.albedoVariance) lines.push_back("no variance.albedo.*: the albedo is taken as free of noise");
  if (in.normal && !in.normalVariance) lines.push_back("no variance.N.*: the normals are taken as free of noise");
  if (!in.depthVariance) lines.push_back("no variance.Z: the depths are taken as free of noise");
  if (!in.counts && in.spp == 0)
    lines.push_back("no samples and no fathom:spp: 64 camera samples a pixel are assumed");
  else if (!in.counts)
    lines.push_back("no samples: counts are taken from the alphas and fathom:spp");
  return lines;
}

bool denoiseReads(const DenoiseInputs& in, const std::string& channel) {
  static constexpr std::array<const char*, 6> kAlways{"R", "G", "B", "A", "Z", "ZBack"};
  if (std::find(kAlways.begin(), kAlways.end(), channel) != kAlways.end()) return true;
  if (channel == "samples") return in.counts;
  if (startsWith(channel, "diffuse.") || startsWith(channel, "specular.")) return in.components;
  if (startsWith(channel, "albedo.")) return in.albedo;
  if (startsWith(channel, "N.")) return in.normal;
  if (channel == "half0.samples" || channel == "half1.samples") return in.halfCounts;
  if (startsWith(channel, "half0.") || startsWith(channel, "half1.")) {
    const std::string group = channel.substr(6);
    if (startsWith(group, "albedo.")) return in.albedoHalves && in.components;
    if (startsWith(group, "diffuse.") || startsWith(group, "specular.")) return in.halves && in.components;
    return in.halves && !in.components && group.size() == 1;
  }
  if (startsWith(channel, "variance.albedo.")) return in.albedoVariance;
  if (startsWith(channel, "variance.N.")) return in.normalVariance;
  if (channel == "variance.Z") return in.depthVariance;
  return channel == "variance.R" || channel == "variance.G" || channel == "variance.B";
}

}  // namespace fathom::deep
