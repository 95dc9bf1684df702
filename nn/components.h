// What more components are worth to a block of a frame, guessed from its planes before the network runs.
//
// Source: Fathom's own; nn/train/components.py fits the coefficients to the errors of each network's K = 1, 2 and 4, and
// leaves them in the metadata of its weight file.
#pragma once

#include <array>
#include <optional>

#include "nn/planes.h"
#include "nn/weights.h"

namespace fathom::nn {

// Means and spreads of a block's planes: nn/train/blocks.py names them one by one.
inline constexpr size_t kBlockStatistics = 12;
using BlockStatistics = std::array<double, kBlockStatistics>;

// `planes`: the network's input, seen from the block's corner, finite. Sides are multiples of 4, and not 0.
BlockStatistics blockStatistics(const ConstPlanes& planes, int height, int width);

class ComponentGains {
 public:
  // From metadata components.gain2 and components.gain4, which are kBlockStatistics numbers each; without both nothing is
  // ever gained. Throws an Error where there is something else.
  explicit ComponentGains(const WeightFile& file);

  bool known() const { return coefficients_.has_value(); }
  // The parts of a block's error that K = 2 and K = 4 are expected to take off, against K = 1; they may be negative.
  std::array<double, 2> of(const BlockStatistics& statistics) const;

 private:
  std::optional<std::array<BlockStatistics, 2>> coefficients_;
};

}  // namespace fathom::nn
