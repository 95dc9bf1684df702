// Open Image Denoise as a flat denoiser.
//
// Source: its manual, filter "RT" with HDR colours; the guides are denoised first and then called clean, as it advises
// for final frames.
#pragma once

#include <memory>
#include <string>

#include "flat/denoiser.h"
#include "flat/oidn_library.h"

namespace fathom::flat {

struct OidnParams {
  enum class Quality { Fast = 4, Balanced = 5, High = 6 };  // the library's numbers

  Quality quality = Quality::High;
  // Denoise albedo and normal before they guide the colours. On two cores six times the time, on most renders a sixth
  // less error; where the guides hold detail that the network takes for noise (hair), more error.
  bool prefilterGuides = true;
  // Megabytes that the library may use beside the images; 0: as many as it likes. With fewer it works in tiles, which
  // takes longer and gives the same bits.
  int scratchMegabytes = 0;
};

// All that decides the result, as text to be hashed.
std::string describeOidn(const OidnLibrary& library, const OidnParams& params);

// The denoiser. It reads R, G, B, where they are there albedo.{R,G,B}, and beside those N.{X,Y,Z}, which the library takes
// only together; A tells which pixels are empty. Values that are not finite count as 0, as do negative colours; albedos
// are clamped to [0,1], normals to [-1,1]. A pixel with A = 0 and no colour stays black. Images of
// fewer than 16 pixels a side are too small for the networks: their result is finite, and no better. Runs on the processor, on as many
// threads as oneTBB may use when it is called; the bits do not depend on how many. Errors of the library become Error.
Denoiser oidn(std::shared_ptr<const OidnLibrary> library, const OidnParams& params);

}  // namespace fathom::flat
