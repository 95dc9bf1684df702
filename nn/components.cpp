#include "nn/components.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"

namespace fathom::nn {

namespace {

constexpr int kCell = 4;
constexpr double kMostGain = 0.5;  // more than any network has taken off on average: what is beyond is no knowledge
constexpr size_t kLightAt = 0, kFeaturesAt = 3, kFeatures = 6, kNoiseAt = 11, kFeatureNoiseAt = 12, kHalvesAt = 15,
                 kRestAt = 16, kKindAt = 23;

// A block of some planes' mean.
class Block {
 public:
  Block(const ConstPlanes& planes, size_t first, size_t count, int height, int width)
      : height_(height), width_(width), values_(size_t(height) * size_t(width)) {
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        for (size_t p = first; p < first + count; ++p) sum += double(planes.row(p, y)[x]);
        values_[size_t(y) * size_t(width) + size_t(x)] = sum / double(count);
      }
    for (int y = 0; y < height; y += kCell)
      for (int x = 0; x < width; x += kCell) cells_.push_back(cellMean(y, x));
    for (const double cell : cells_) mean_ += cell / double(cells_.size());
  }

  double mean() const { return mean_; }

  double spread() const {
    double sum = 0;
    for (const double cell : cells_) sum += (cell - mean_) * (cell - mean_);
    return std::sqrt(sum / double(cells_.size()));
  }

  // The mean distance from the cell's mean.
  double grain() const {
    double sum = 0;
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x)
        sum += std::abs(at(y, x) - cells_[size_t(y / kCell) * size_t(width_ / kCell) + size_t(x / kCell)]);
    return sum / double(values_.size());
  }

 private:
  double at(int y, int x) const { return values_[size_t(y) * size_t(width_) + size_t(x)]; }

  double cellMean(int y, int x) const {
    double sum = 0;
    for (int dy = 0; dy < kCell; ++dy)
      for (int dx = 0; dx < kCell; ++dx) sum += at(y + dy, x + dx);
    return sum / (kCell * kCell);
  }

  int height_, width_;
  std::vector<double> values_, cells_;
  double mean_ = 0;
};

BlockStatistics coefficientsOf(const WeightFile& file, const std::string& key) {
  const std::string& text = file.metadata.at(key);
  BlockStatistics result{};
  const char *at = text.data(), *const end = at + text.size();
  for (double& value : result) {
    while (at != end && *at == ' ') ++at;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || !std::isfinite(value))
      fail("{}, metadata {}: expected {} numbers, found {}", file.name, key, kBlockStatistics,
           printable(text.substr(0, 60)));
    at = next;
  }
  if (at != end) fail("{}, metadata {}: expected {} numbers, found more", file.name, key, kBlockStatistics);
  return result;
}

}  // namespace

BlockStatistics blockStatistics(const ConstPlanes& planes, int height, int width) {
  const auto block = [&](size_t first, size_t count) { return Block(planes, first, count, height, width); };
  const Block light = block(kLightAt, 3), noise = block(kNoiseAt, 1);
  double features = 0;
  for (size_t p = kFeaturesAt; p < kFeaturesAt + kFeatures; ++p) features += block(p, 1).spread() / kFeatures;
  const double kind = double(planes.row(kKindAt, 0)[0]);
  return {1,
          noise.mean(),
          block(kHalvesAt, 1).mean(),
          light.mean(),
          light.spread(),
          light.grain(),
          features,
          block(kFeatureNoiseAt, 3).mean(),
          block(kRestAt, 3).mean(),
          noise.spread(),
          kind,
          kind == 0 ? 0.0 : 1.0};
}

ComponentGains::ComponentGains(const WeightFile& file) {
  const std::string names[] = {"components.gain2", "components.gain4"};
  const bool first = file.metadata.contains(names[0]), second = file.metadata.contains(names[1]);
  if (first != second) fail("{}: metadata {} is missing", file.name, names[first ? 1 : 0]);
  if (first) coefficients_ = {coefficientsOf(file, names[0]), coefficientsOf(file, names[1])};
}

std::array<double, 2> ComponentGains::of(const BlockStatistics& statistics) const {
  std::array<double, 2> result{};
  if (!known()) return result;
  for (size_t i = 0; i < result.size(); ++i) {
    double sum = 0;
    for (size_t k = 0; k < kBlockStatistics; ++k) sum += (*coefficients_)[i][k] * statistics[k];
    result[i] = std::clamp(sum, -kMostGain, kMostGain);
  }
  return result;
}

}  // namespace fathom::nn
