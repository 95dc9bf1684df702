// Which channels of a deep frame the layered network reads, and what it makes of those that are missing.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "deep/attributes.h"

namespace fathom::deep {

// What of the channel convention a frame offers to the network.
struct LayerInputs {
  bool components = false;  // diffuse.* and specular.*; else R G B
  bool albedo = false, normal = false, coc = false, lens = false;
  bool diffuseVariance = false, specularVariance = false, variance = false;
  bool counts = false;  // samples
  int spp = 0;          // fathom:spp; 0: unknown

  // Whether each deep sample is one of the spp camera samples: nothing tells of bins.
  bool cameraSamples() const { return spp > 0 && !counts && !diffuseVariance && !specularVariance && !variance; }
};

LayerInputs findLayerInputs(std::span<const std::string> channels, const Attributes& attributes);

// One line per thing that is missing and what the network takes instead, for an artist.
std::vector<std::string> describeMissing(const LayerInputs& inputs);

// Whether the network reads a channel of this name, given what the frame offers.
bool layersRead(const LayerInputs& inputs, const std::string& channel);

}  // namespace fathom::deep
