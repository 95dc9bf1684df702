// Source of the order and the luminance: the ASC colour decision list (slope, offset, power, saturation). Written so
// that only gamma divides by alpha.
#include "deep/ops/grade.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/ops/named_channels.h"
#include "deep/volume.h"
#include "flat/limited.h"

namespace fathom::deep {

namespace {

constexpr size_t kBlock = 1024;  // samples that are worked on at once, in the cache
constexpr std::array<float, 3> kLuminance{0.2126f, 0.7152f, 0.0722f};

using Block = std::array<float, kBlock>;
// The values of R, G and B of one layer; null where a channel is missing.
using Triple = std::array<float*, 3>;

size_t component(const std::string& channel) {
  const size_t at = std::string_view("RGB").find(channel.back());
  const bool last = channel.size() == 1 || channel[channel.size() - 2] == '.';
  if (at == std::string_view::npos || !last) fail("expected channels R, G and B, found {}", channel);
  return at;
}

std::vector<Triple> triplesOf(DeepImage& image, const std::vector<std::string>& channels, bool whole) {
  std::vector<Triple> triples;
  std::vector<std::string> layers;
  for (const std::string& name : channels) {
    const std::string layer = name.substr(0, name.size() - 1);
    const auto found = std::ranges::find(layers, layer);
    const auto at = size_t(found - layers.begin());
    if (found == layers.end()) layers.push_back(layer), triples.push_back({});
    triples[at][component(name)] = image.get(name).data();
  }
  for (size_t i = 0; i < triples.size(); ++i)
    for (size_t c = 0; whole && c < 3; ++c)
      if (!triples[i][c]) fail("saturation: expected channel {}{} among those to grade", layers[i], "RGB"[c]);
  return triples;
}

// Of t up to 1; what is below 0, or no number, is 0.
float smooth(float t) {
  t = std::max(0.0f, t);
  return t * t * (3 - 2 * t);
}

float weightAt(const GradeParams& params, float z) {
  float weight = 1;
  if (z < params.near) weight = params.nearWidth > 0 ? smooth(1 - (params.near - z) / params.nearWidth) : 0;
  if (z >= params.far && params.far < std::numeric_limits<float>::infinity())
    weight *= params.farWidth > 0 ? smooth(1 - (z - params.far) / params.farWidth) : 0;
  return weight;
}

// What is known of a block's samples, whatever the channel.
struct Samples {
  size_t count;
  Block alpha, weight;
};

// (value / alpha) ^ power * alpha. In double where a step of it is beyond what floats hold: light of hardly any alpha.
float raised(float value, float alpha, float power) {
  const float quotient = value / alpha, result = std::pow(quotient, power);
  if (std::isnormal(quotient) && std::isnormal(result)) return std::min(result * alpha, kLargest);
  return float(std::min(std::pow(double(value) / double(alpha), double(power)) * double(alpha), double(kLargest)));
}

void gradeTriple(const GradeParams& params, const Samples& samples, const Triple& values, std::array<Block, 3>& out) {
  for (size_t c = 0; c < 3; ++c) {
    const float* in = values[c];
    if (!in) continue;
    const float gain = params.gain[c], offset = params.offset[c], power = 1 / params.gamma[c];
    for (size_t i = 0; i < samples.count; ++i)
      out[c][i] = limited(finiteOrZero(in[i]) * gain + samples.alpha[i] * offset);
    for (size_t i = 0; power != 1 && i < samples.count; ++i)
      if (samples.alpha[i] > 0 && out[c][i] > 0) out[c][i] = raised(out[c][i], samples.alpha[i], power);
  }
  if (params.saturation == 1) return;
  for (size_t i = 0; i < samples.count; ++i) {
    const float grey = kLuminance[0] * out[0][i] + kLuminance[1] * out[1][i] + kLuminance[2] * out[2][i];
    for (size_t c = 0; c < 3; ++c) out[c][i] = grey + params.saturation * (out[c][i] - grey);
  }
}

void store(const Samples& samples, const Block& graded, float* values) {
  for (size_t i = 0; i < samples.count; ++i) {
    const float weight = samples.weight[i], before = values[i];
    values[i] = weight == 0 ? before : (1 - weight) * finiteOrZero(before) + weight * limited(graded[i]);
  }
}

void check(const GradeParams& params) {
  for (const float gamma : params.gamma)
    if (!(gamma > 0)) fail("gamma: expected numbers above 0, found {}", gamma);
  for (size_t c = 0; c < 3; ++c)
    for (const float number : {params.gain[c], params.offset[c], params.saturation})
      if (!std::isfinite(number)) fail("grade: expected finite numbers, found {}", number);
}

}  // namespace

DeepImage grade(DeepImage image, const GradeParams& params) {
  check(params);
  const std::vector<std::string> channels = channelsNamed(params.channels, floatChannels(image));
  for (const std::string& name : statisticsOf(image, channels)) image.erase(name);
  const std::vector<Triple> triples = triplesOf(image, channels, params.saturation != 1);
  const std::span<const float> alpha = image.get("A"), z = image.get("Z"), zBack = image.tryGet("ZBack");
  const size_t total = image.samples();
  parallelFor(0, int((total + kBlock - 1) / kBlock), [&](int block) {
    const size_t first = size_t(block) * kBlock;
    Samples samples{std::min(kBlock, total - first), {}, {}};
    for (size_t i = 0; i < samples.count; ++i) {
      const size_t s = first + i;
      samples.alpha[i] = float(opacity(alpha[s]));
      samples.weight[i] = weightAt(params, float(usableRange(z[s], zBack.empty() ? z[s] : zBack[s]).middle()));
    }
    std::array<Block, 3> graded;
    for (Triple values : triples) {
      for (float*& channel : values)
        if (channel) channel += first;
      gradeTriple(params, samples, values, graded);
      for (size_t c = 0; c < 3; ++c)
        if (values[c]) store(samples, graded[c], values[c]);
    }
  });
  return image;
}

}  // namespace fathom::deep
