// Clustering the camera samples of one pixel in double precision, from appendix A and the definitions of mean and
// variance.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace fathom::reference {

struct CameraSample {
  double z, value;  // the value is not premultiplied
};

struct Bin {
  double z, mean, variance, zVariance;
  int count;
};

inline std::vector<Bin> cluster(std::vector<CameraSample> samples, double ppuScale, double E, double first) {
  std::sort(samples.begin(), samples.end(), [](const CameraSample& a, const CameraSample& b) { return a.z < b.z; });
  std::vector<std::vector<double>> groups;
  double sum = 0;
  for (size_t k = 0; k < samples.size(); ++k) {
    if (k > 0) sum += (samples[k].z - samples[k - 1].z) * ppuScale / samples[k - 1].z;
    if (k == 0 || sum > std::pow(double(groups.size()) + first, E)) {
      groups.emplace_back();
      sum = 0;
    }
    groups.back().push_back(samples[k].z);
  }
  std::vector<Bin> bins;
  for (const auto& group : groups) {
    double z = 0;
    for (const double depth : group) z += depth;
    bins.push_back({double(float(z / double(group.size()))), 0, 0, 0, 0});
  }
  std::vector<std::vector<CameraSample>> members(bins.size());
  for (const CameraSample& sample : samples) {
    size_t best = 0;
    for (size_t b = 1; b < bins.size(); ++b)
      if (std::abs(bins[b].z - sample.z) < std::abs(bins[best].z - sample.z)) best = b;
    members[best].push_back(sample);
  }
  for (size_t b = 0; b < bins.size(); ++b) {
    const double n = double(members[b].size());
    double z = 0;
    bins[b].count = int(n);
    for (const CameraSample& sample : members[b]) bins[b].mean += sample.value / n, z += sample.z / n;
    for (const CameraSample& sample : members[b])
      if (n > 1) {
        bins[b].variance += (sample.value - bins[b].mean) * (sample.value - bins[b].mean) / (n - 1) / n;
        bins[b].zVariance += (sample.z - z) * (sample.z - z) / (n - 1) / n;
      }
  }
  return bins;
}

}  // namespace fathom::reference
