#include "deep/selection.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/parallel.h"
#include "deep/still.h"
#include "flat/bilateral.h"

namespace fathom::deep {

namespace {

using Rgb = std::array<float, 3>;

constexpr float kLeastWeight = 1e-12f;  // sums of weights below this say nothing
constexpr float kErrorSharpness = 2;    // see BilateralParams
constexpr float kBlendSigma = 2.5f;
constexpr float kLeastError = 0.03f;  // of the largest candidate's error: below it estimates are noise

// What the halves of one candidate come to in one pixel.
struct PixelHalves {
  std::array<Rgb, 2> filtered{}, noisy{};
  std::array<float, 2> share{};
  float alpha = 0;
};

// The filtered values of both halves of a bin; a half without weights takes the other's. False where neither has any.
bool filteredHalves(const float* sums, std::array<Rgb, 2>& value) {
  const bool has[2] = {sums[3] > kLeastWeight, sums[7] > kLeastWeight};
  if (!has[0] && !has[1]) return false;
  for (size_t h = 0; h < 2; ++h) {
    const size_t from = has[h] ? h : 1 - h;
    const float inverse = 1 / sums[4 * from + 3];
    for (size_t i = 0; i < 3; ++i) value[h][i] = sums[4 * from + i] * inverse;
  }
  return true;
}

// A candidate that found nothing for a bin takes the value of the last one that did: colour weights find no one where a
// pixel is not finite, feature weights do.
void fillFromOthers(size_t bin, Candidates& candidates) {
  const unsigned known = candidates.known[bin];
  if (known == 0) return;
  const float* value = candidates.value[size_t(std::bit_width(known) - 1)].data() + 3 * bin;
  for (size_t k = 0; k < candidates.value.size(); ++k)
    if (!(known >> k & 1)) std::copy_n(value, 3, candidates.value[k].data() + 3 * bin);
}

// Adds one bin of one candidate; `in` is the bin's noisy data. False where the candidate found nothing.
bool addBin(const float* in, const float* sums, const float* own, float weight, PixelHalves& pixel, float* out) {
  std::array<Rgb, 2> f;
  std::fill_n(out, 3, 0.0f);
  if (!filteredHalves(sums, f)) return false;
  pixel.alpha += weight;
  for (size_t c = 0; c < 3; ++c) out[c] = 0.5f * (f[0][c] + f[1][c]);
  for (size_t h = 0; h < 2; ++h) {
    const size_t from = in[4 * h + 3] > 0 ? h : 1 - h;
    const float scale = in[4 * from + 3] > 0 ? weight / in[4 * from + 3] : 0;
    for (size_t c = 0; c < 3; ++c) {
      pixel.filtered[h][c] += weight * f[h][c];
      pixel.noisy[h][c] += scale * in[4 * from + c];
    }
    if (sums[4 * h + 3] > kLeastWeight) pixel.share[h] += weight * own[h] / sums[4 * h + 3];
  }
  return true;
}

void keepAnswer(const PixelHalves& halves, size_t pixel, HalfAnswer& answer) {
  if (!(halves.alpha > 0)) return;
  for (size_t c = 0; c < 3; ++c) answer.difference[c][pixel] = halves.filtered[0][c] - halves.filtered[1][c];
  for (size_t h = 0; h < 2; ++h) answer.share[h][pixel] = halves.share[h] / halves.alpha;
}

float squaredError(const PixelHalves& pixel) {
  if (!(pixel.alpha > 0)) return 0;
  float error = 0;
  for (size_t c = 0; c < 3; ++c) {
    const float e = pixel.noisy[0][c] - pixel.noisy[1][c];
    const float variance = 0.5f * e * e;
    for (size_t h = 0; h < 2; ++h) {
      const float r = pixel.filtered[h][c] - pixel.noisy[h][c];
      error += 0.5f * (r * r - (1 - 2 * pixel.share[h] / pixel.alpha) * variance);
    }
    const float d = pixel.filtered[0][c] - pixel.filtered[1][c];
    error -= 0.25f * d * d;
  }
  return error;
}

// Equation 13.
float squaredErrorByOtherHalf(const PixelHalves& pixel) {
  if (!(pixel.alpha > 0)) return 0;
  float error = 0;
  for (size_t c = 0; c < 3; ++c) {
    const float r0 = pixel.filtered[0][c] - pixel.noisy[1][c], r1 = pixel.filtered[1][c] - pixel.noisy[0][c];
    const float e = pixel.noisy[0][c] - pixel.noisy[1][c], d = pixel.filtered[0][c] - pixel.filtered[1][c];
    error += 0.5f * (r0 * r0 + r1 * r1) - 0.5f * e * e - 0.25f * d * d;
  }
  return error;
}

// Stein's without halves: the weights do know the noise of what they average, and the estimate is a little too small.
float squaredErrorOfWhole(const PixelHalves& pixel, const GuideVariance& variance, int x, int y) {
  if (!(pixel.alpha > 0)) return 0;
  float error = 0;
  for (size_t c = 0; c < 3; ++c) {
    const float r = pixel.filtered[0][c] - pixel.noisy[0][c];
    error += r * r - (1 - 2 * pixel.share[0] / pixel.alpha) * variance.value[c].row(y)[x];
  }
  return error;
}

// Gaussian of kBlendSigma, separable, in place.
void blur(const DenoiseData& data, std::span<const uint8_t> wantedRows, flat::Padded& plane) {
  std::array<float, 2 * kBlendRadius + 1> kernel;
  float sum = 0;
  for (int i = -kBlendRadius; i <= kBlendRadius; ++i) {
    kernel[size_t(i + kBlendRadius)] = std::exp(-0.5f * float(i * i) / (kBlendSigma * kBlendSigma));
    sum += kernel[size_t(i + kBlendRadius)];
  }
  for (float& k : kernel) k /= sum;
  plane.extend();
  flat::Padded across(data.width, data.height, kBlendRadius);
  parallelFor(0, data.height, [&](int y) {
    std::fill_n(across.row(y), data.width, 0.0f);
    if (!wantedRows[size_t(y)]) return;
    for (int i = -kBlendRadius; i <= kBlendRadius; ++i)
      for (int x = 0; x < data.width; ++x) across.row(y)[x] += kernel[size_t(i + kBlendRadius)] * plane.row(y)[x + i];
  });
  across.extend();
  parallelFor(0, data.height, [&](int y) {
    std::fill_n(plane.row(y), data.width, 0.0f);
    if (!wantedRows[size_t(y)]) return;
    for (int i = -kBlendRadius; i <= kBlendRadius; ++i)
      for (int x = 0; x < data.width; ++x) plane.row(y)[x] += kernel[size_t(i + kBlendRadius)] * across.row(y + i)[x];
  });
}

// Replaces the errors of a pixel by 1 where they are least and 0 elsewhere.
void chooseBest(int x, int y, std::vector<flat::Padded>& error) {
  size_t best = 0;
  for (size_t k = 1; k < error.size(); ++k)
    if (error[k].row(y)[x] < error[best].row(y)[x]) best = k;
  for (size_t k = 0; k < error.size(); ++k) error[k].row(y)[x] = k == best ? 1 : 0;
}

// Replaces errors by the candidates' parts of the blend, which sum to one.
void blendWeights(const DenoiseData& data, const Buffer<uint8_t>& wanted, float level, bool best,
                  std::vector<flat::Padded>& error) {
  const float least = 1e-12f * level * level;
  std::vector<uint8_t> rows(size_t(data.height));
  parallelFor(0, data.height, [&](int y) {
    const uint8_t* row = wanted.data() + size_t(y) * size_t(data.width);
    rows[size_t(y)] = std::any_of(row, row + data.width, [](uint8_t w) { return w != 0; });
    if (!rows[size_t(y)]) return;
    for (int x = 0; x < data.width; ++x) {
      if (best) {
        chooseBest(x, y, error);
        continue;
      }
      float worst = 0, sum = 0;
      for (const flat::Padded& e : error) worst = std::max(worst, e.row(y)[x]);
      for (flat::Padded& e : error) {
        const float ratio = (worst + least) / (std::max(e.row(y)[x], kLeastError * worst) + least);
        sum += e.row(y)[x] = ratio * ratio;
      }
      for (flat::Padded& e : error) e.row(y)[x] /= sum;
    }
  });
  for (flat::Padded& e : error) blur(data, rows, e);
}

// The flattened halves blended, and the variance of each from their difference.
ComponentGuide makePilot(const DenoiseData& data, const Candidates& candidates, const std::vector<flat::Padded>& parts,
                         int pad) {
  ComponentGuide pilot;
  for (size_t c = 0; c < 3; ++c) {
    for (size_t h = 0; h < 2; ++h) pilot.value[h].value[c] = flat::Padded(data.width, data.height, pad);
    flat::Padded& variance = pilot.variance.value[c] = flat::Padded(data.width, data.height, pad);
    parallelFor(0, data.height, [&](int y) {
      for (int x = 0; x < data.width; ++x) {
        std::array<float, 2> sum{};
        for (size_t h = 0; h < 2; ++h) {
          for (size_t k = 0; k < parts.size(); ++k)
            sum[h] += parts[k].row(y)[x] * candidates.halves[k][h].value[c].row(y)[x];
          pilot.value[h].value[c].row(y)[x] = sum[h];
        }
        variance.row(y)[x] = 0.5f * (sum[0] - sum[1]) * (sum[0] - sum[1]);
      }
    });
    for (size_t h = 0; h < 2; ++h) pilot.value[h].value[c].extend();
    prefilterVariance(variance, data.width, data.height);
  }
  return pilot;
}

// A candidate that found nothing for a pixel adds nothing.
HalfAnswer blendAnswers(const DenoiseData& data, const std::vector<HalfAnswer>& answers,
                        const std::vector<flat::Padded>& parts) {
  const size_t width = size_t(data.width);
  HalfAnswer result(width * size_t(data.height));
  parallelFor(0, data.height, [&](int y) {
    const auto add = [&](const Buffer<float>& from, const float* part, Buffer<float>& to) {
      for (size_t x = 0; x < width; ++x) to[size_t(y) * width + x] += part[x] * from[size_t(y) * width + x];
    };
    for (size_t k = 0; k < parts.size(); ++k) {
      for (size_t c = 0; c < 3; ++c) add(answers[k].difference[c], parts[k].row(y), result.difference[c]);
      for (size_t h = 0; h < 2; ++h) add(answers[k].share[h], parts[k].row(y), result.share[h]);
    }
  });
  return result;
}

}  // namespace

HalfAnswer::HalfAnswer(size_t pixels) {
  for (Buffer<float>& plane : difference) plane = Buffer<float>(pixels, 0.0f);
  for (Buffer<float>& plane : share) plane = Buffer<float>(pixels, 0.0f);
}

Candidates::Candidates(const DenoiseData& data, int candidates, const SelectionParams& selection, Wanted wanted)
    : params(selection), known(data.bins(), 0) {
  const auto zeros = [&] {
    flat::Padded plane(data.width, data.height, std::max(kErrorRadius, kBlendRadius));
    for (int y = 0; y < data.height; ++y) std::fill_n(plane.row(y), data.width, 0.0f);
    return plane;
  };
  for (int k = 0; k < candidates; ++k) {
    value.emplace_back(data.bins() * 3);
    error.push_back(zeros());
    if (wanted.answer) answers.emplace_back(size_t(data.width) * size_t(data.height));
    if (!wanted.pilot) continue;
    std::array<Guide, 2>& guides = halves.emplace_back();
    for (Guide& guide : guides)
      for (flat::Padded& plane : guide.value) plane = zeros();
  }
  for (int c = 0; c < 3; ++c) flattened.push_back(zeros());
}

void addCandidates(const DenoiseData& data, const DenoiseComponent& component, const GuideVariance& variance,
                   const FilterTile& tile, int c, int first, const Buffer<uint8_t>& still, Candidates& candidates) {
  const bool byOtherHalf = candidates.params.error == ErrorEstimate::OtherHalf;
  const float parts = float(2 * candidates.value.size());
  size_t i = 0;
  for (int y = tile.box.y0; y < tile.box.y1; ++y) {
    for (int x = tile.box.x0; x < tile.box.x1; ++x) {
      const size_t pixel = size_t(y) * size_t(data.width) + size_t(x);
      const size_t begin = size_t(data.offsets[pixel]), end = size_t(data.offsets[pixel + 1]);
      for (int k = 0; k < tile.candidates && !still[pixel]; ++k) {
        const size_t candidate = size_t(first + k);
        PixelHalves halves;
        for (size_t b = begin; b < end; ++b) {
          const bool found =
              addBin(component.data.data() + 8 * b, tile.at(i + b - begin, c, k), tile.own(i + b - begin, c, k),
                     data.weight[b], halves, candidates.value[candidate].data() + 3 * b);
          candidates.known[b] = uint8_t(candidates.known[b] | unsigned(found) << candidate);
        }
        candidates.error[candidate].row(y)[x] = !data.halves  ? squaredErrorOfWhole(halves, variance, x, y)
                                                : byOtherHalf ? squaredErrorByOtherHalf(halves)
                                                              : squaredError(halves);
        for (size_t h = 0; h < 2 && !candidates.halves.empty(); ++h)
          for (size_t ch = 0; ch < 3; ++ch)
            candidates.halves[candidate][h].value[ch].row(y)[x] = halves.filtered[h][ch];
        if (!candidates.answers.empty()) keepAnswer(halves, pixel, candidates.answers[candidate]);
        for (size_t ch = 0; ch < 3; ++ch)
          candidates.flattened[ch].row(y)[x] += (halves.filtered[0][ch] + halves.filtered[1][ch]) / parts;
      }
      i += end - begin;
    }
  }
}

void addDarkness(const DenoiseData& data, const Box& tile, Candidates& candidates) {
  for (int y = tile.y0; y < tile.y1; ++y) {
    const uint64_t* row = data.offsets + size_t(y) * size_t(data.width);
    for (Buffer<float>& value : candidates.value)
      std::fill(value.data() + 3 * row[tile.x0], value.data() + 3 * row[tile.x1], 0.0f);
  }
}

Blend blendCandidates(const DenoiseData& data, const Buffer<uint8_t>& still, Candidates candidates, float level,
                      int pad) {
  for (flat::Padded& plane : candidates.error) plane.extend();
  for (flat::Padded& plane : candidates.flattened) plane.extend();
  std::vector<flat::Padded> smooth;
  for (size_t k = 0; k < candidates.error.size(); ++k) smooth.emplace_back(data.width, data.height, kBlendRadius);
  flat::BilateralParams params;
  params.radius = kErrorRadius;
  params.sharpness = kErrorSharpness;
  params.floor = 4e-4f * level * level;
  // Still pixels keep their colours: only what is blurred into others is wanted there.
  Buffer<uint8_t> wanted = allWithin(still, data.width, data.height, kBlendRadius);
  for (uint8_t& w : wanted) w = !w;
  flat::bilateral(data.width, data.height, params, wanted, candidates.flattened, candidates.error, smooth);
  blendWeights(data, wanted, level, candidates.params.best, smooth);
  parallelFor(0, data.height, [&](int y) {
    const uint64_t* offsets = data.offsets + size_t(y) * size_t(data.width);
    for (int x = 0; x < data.width; ++x) {
      if (still[size_t(y) * size_t(data.width) + size_t(x)]) continue;
      for (size_t b = size_t(offsets[x]); b < size_t(offsets[x + 1]); ++b) {
        fillFromOthers(b, candidates);
        for (size_t c = 0; c < 3; ++c) {
          float sum = 0;
          for (size_t k = 0; k < smooth.size(); ++k) sum += smooth[k].row(y)[x] * candidates.value[k][3 * b + c];
          candidates.value[0][3 * b + c] = sum;
        }
      }
    }
  });
  Blend blend{std::move(candidates.value[0]), std::move(candidates.known), {}, {}};
  if (!candidates.halves.empty()) blend.pilot = makePilot(data, candidates, smooth, pad);
  if (!candidates.answers.empty()) blend.answer = blendAnswers(data, candidates.answers, smooth);
  return blend;
}

}  // namespace fathom::deep
