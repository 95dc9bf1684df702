// Id mattes: how much of each pixel is seen of which id.
//
// An id's coverage is the sum of the effective alphas of its samples, decided as flatten does (see RowCompositor):
// hidden samples count for nothing, volumes and coincident samples by their part, and the coverages of all ids of a
// pixel sum to its alpha. Colours have no say. Samples may lie in any order. Empty pixels are 0. Halo 0.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// The coverage of all `values` of a UINT channel together, in plane A; 0 is an id like others. Throws Error where A, Z
// or the channel is missing, or the channel is not UINT.
flat::Image idMatte(const DeepImage& image, const std::string& channel, std::span<const uint32_t> values);

// The coverage of each of them in a plane of its own, CHANNEL.VALUE in decimal: "id.7"; a value given twice counts once.
flat::Image idMattes(const DeepImage& image, const std::string& channel, std::span<const uint32_t> values);

struct RankedIds {
  flat::Image image;
  size_t most = 0;  // ids of the pixel with most
};

// The ids of each pixel by falling coverage (equal ones by rising id), as Cryptomatte 1.2 lays them out: planes
// CHANNEL00.R (id) .G (coverage) .B .A (the next id and its coverage), CHANNEL01.R and so on, two ranks each, so that
// there is an even number of them, at least `ranks` (1 to 200); what is left of a pixel is 0. With the attributes
// cryptomatte/KEY/name, hash and conversion; a manifest stays where the image has one for a layer of the channel's name.
// Ids are the bits of floats; as the specification has it for hashes, those whose exponent is 0 or 255 (zero,
// subnormals, infinities, NaN: which programs change or lose) have bit 23 flipped: id 7 is stored as 0x00800007.
// Throws Error as idMatte does.
RankedIds rankIds(const DeepImage& image, const std::string& channel, int ranks);

// The bits under which rankIds stores an id.
uint32_t cryptomatteBits(uint32_t id);

}  // namespace fathom::deep
