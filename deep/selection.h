// Which candidate filter is best where: error estimates of the flattened candidates, and the maps that blend them.
//
// Source: Vicini et al., section 4.2, "Color filtering". Three departures, each measured on the shared renders (the first
// and the last only where SelectionParams do not ask for the paper's way):
// - Equation 13 compares a filtered half with the other half. With crossed weights the filtered half already knows the
//   other half's noise, and strong colour weights look better than they are. Given weights that do not know it, the filter is
//   linear in its own half and Stein's estimate needs no derivative of the weights: MSE[F_h] = (F_h - C_h)^2 - (1 - 2
//   s_h) Var[C_h], with s_h the share of the sum of weights that the pixel itself has; and MSE[F] = (MSE[F_0] +
//   MSE[F_1]) / 2 - Var[F], with Var[F] = (F_0 - F_1)^2 / 4 as in the paper.
// - The estimates are smoothed by the flat filter over 11x11 pixels with weights from the candidates' own flattened
//   colour.
// - Candidates are mixed in proportion to 1 / MSE^2 instead of taking the best one: a sixth less error on average.
#pragma once

#include <vector>

#include "deep/denoise_data.h"
#include "deep/guide.h"

namespace fathom::deep {

inline constexpr int kMaxPassCandidates = 8;
inline constexpr int kErrorRadius = 5, kBlendRadius = 5;

enum class ErrorEstimate { Stein, OtherHalf };

struct SelectionParams {
  ErrorEstimate error = ErrorEstimate::Stein;  // OtherHalf: equation 13; without halves it is Stein's all the same
  bool best = false;                           // the candidate with the least error alone, by a smoothed map
};

// What the halves of the filtered pixels tell of their noise (deep/noise_response).
struct HalfAnswer {
  std::array<Buffer<float>, 3> difference;  // half 0 less half 1, flattened
  std::array<Buffer<float>, 2> share;       // by half, of the sum of weights: that of the pixel itself

  HalfAnswer() = default;
  explicit HalfAnswer(size_t pixels);  // all 0
};

// What of the halves is kept.
struct Wanted {
  bool pilot = false, answer = false;
};

// What a pass made of one component.
struct Candidates {
  SelectionParams params;
  std::vector<Buffer<float>> value;  // [candidate], per bin 3; still pixels' are never set nor read
  Buffer<uint8_t> known;             // per bin, bit k: candidate k found something for it; 0 also where all are dark
  // [candidate], per pixel: estimated squared error of the flattened value, R + G + B; unbiased, so negative at times.
  std::vector<flat::Padded> error;
  std::vector<flat::Padded> flattened;       // [channel], per pixel: the mean of the candidates
  std::vector<std::array<Guide, 2>> halves;  // [candidate][half]: flattened; only where a pilot is wanted
  std::vector<HalfAnswer> answers;           // [candidate]: only where wanted

  Candidates(const DenoiseData& data, int candidates, const SelectionParams& params, Wanted wanted = {});
};

// Adds the sums of one tile, where the component is the c-th that was filtered; its candidates are those from `first`
// on. Pixels with still[pixel] != 0 are left at 0. `variance`: of the flattened component, used where there are no
// halves.
void addCandidates(const DenoiseData& data, const DenoiseComponent& component, const GuideVariance& variance,
                   const FilterTile& tile, int c, int first, const Buffer<uint8_t>& still, Candidates& candidates);

// The same for a tile where the component has no light: all candidates' values are 0.
void addDarkness(const DenoiseData& data, const Box& tile, Candidates& candidates);

struct Blend {
  Buffer<float> value;    // per bin 3
  Buffer<uint8_t> known;  // per bin: 0 where no candidate found anything, or all are dark
  // Where wanted, for a second pass: the flattened blend of each half and its two-buffer variance.
  ComponentGuide pilot;
  HalfAnswer answer;  // where wanted
};

// Blends the candidates and takes their storage. `level`: the mean colour of the frame; `pad`: the border of the pilot.
Blend blendCandidates(const DenoiseData& data, const Buffer<uint8_t>& still, Candidates candidates, float level,
                      int pad);

}  // namespace fathom::deep
