// The joint filter of the deep denoiser written out after the paper's equations, in double precision, for tests.
//
// Source: Vicini et al., equations 1 to 8, with the departures that deep/joint_filter.h states.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "deep/joint_filter.h"

namespace fathom::reference {

// Per bin, component, candidate and block: the sums of w * (r, g, b, 1), what bounds the rounding of each, and the part
// of the last one that is the own pixel's.
struct JointSums {
  struct Entry {
    double sum[4] = {}, magnitude[4] = {};
    double own = 0;
  };
  size_t components = 0, candidates = 0;
  std::vector<Entry> entries;

  const Entry& at(size_t bin, size_t component, size_t candidate, size_t block) const {
    return entries[((bin * components + component) * candidates + candidate) * 2 + block];
  }
};

// Equations 2 and 3 without k: the mean over a patch of the normalised distance of one block's guide.
inline double patchDistance(const deep::FilterComponent& component, const deep::JointFilterParams& params, int block,
                            int x, int y, int dx, int dy) {
  const size_t h = size_t(block);
  double sum = 0;
  for (int j = -params.patchRadius; j <= params.patchRadius; ++j)
    for (int i = -params.patchRadius; i <= params.patchRadius; ++i)
      for (size_t c = 0; c < 3; ++c) {
        const auto value = [&](const flat::Padded& plane, int ox, int oy) {
          return double(plane.row(y + j + oy)[x + i + ox]);
        };
        const double p = value(component.guide[h]->value[c], 0, 0), q = value(component.guide[h]->value[c], dx, dy);
        const double vp = value(component.variance[h]->value[c], 0, 0);
        const double vq = value(component.variance[h]->value[c], dx, dy);
        sum += ((p - q) * (p - q) - (vp + std::min(vp, vq))) / (double(params.epsilon) + vp + vq) / 3;
      }
  const int side = 2 * params.patchRadius + 1;
  return std::max(0.0, sum / (side * side));
}

// Equations 4 and 5: the largest of the distances of the features, each the mean over its channels.
inline double featureDistance(const deep::JointFilterInput& in, double tau, size_t pixel, size_t b, size_t d) {
  double worst = 0;
  for (size_t j = 0; j < in.features.size();) {
    const size_t channels = j + 1 < in.features.size() ? 3 : 1;
    double sum = 0;
    for (size_t end = j + channels; j < end; ++j) {
      const deep::FeatureChannel& f = in.features[j];
      const double e = double(f.value[b]) - double(f.value[d]), vb = f.variance[b], vd = f.variance[d];
      sum += (e * e - (vb + std::min(vb, vd))) / std::max(tau, std::max(vb, double(f.gradient2[pixel])));
    }
    worst = std::max(worst, sum / double(channels));
  }
  return worst;
}

inline JointSums jointFilter(const deep::JointFilterInput& in, const deep::JointFilterParams& params) {
  const size_t width = size_t(in.width), components = in.components.size(), candidates = size_t(params.candidates);
  const size_t bins = size_t(in.offsets[width * size_t(in.height)]);
  JointSums result{components, candidates, std::vector<JointSums::Entry>(bins * components * candidates * 2)};
  for (int y = 0; y < in.height; ++y)
    for (int x = 0; x < in.width; ++x) {
      const size_t p = size_t(y) * width + size_t(x);
      for (int dy = -params.radius; dy <= params.radius; ++dy)
        for (int dx = -params.radius; dx <= params.radius; ++dx) {
          if (x + dx < 0 || x + dx >= in.width || y + dy < 0 || y + dy >= in.height) continue;
          const size_t q = size_t(y + dy) * width + size_t(x + dx);
          if (in.offsets[p] == in.offsets[p + 1] || in.offsets[q] == in.offsets[q + 1]) continue;
          for (size_t c = 0; c < components; ++c) {
            double colour[2] = {};
            for (int h = 0; h < 2 && params.colourCandidates > 0; ++h)
              colour[h] = patchDistance(in.components[c], params, params.crossed ? 1 - h : h, x, y, dx, dy);
            for (size_t b = in.offsets[p]; b < in.offsets[p + 1]; ++b)
              for (size_t d = in.offsets[q]; d < in.offsets[q + 1]; ++d) {
                const double feature = featureDistance(in, double(params.tau), p, b, d);
                for (size_t k = 0; k < candidates; ++k)
                  for (size_t h = 0; h < 2; ++h) {
                    const double kf = params.kFeature[k];
                    double w = std::exp(-feature / (kf * kf));
                    if (k < size_t(params.colourCandidates)) {
                      const double ko = params.kColour[k];
                      w = std::min(w, std::exp(-colour[h] / (ko * ko)));
                    }
                    JointSums::Entry& entry = result.entries[((b * components + c) * candidates + k) * 2 + h];
                    for (size_t i = 0; i < 4; ++i) {
                      const double add = w * double(in.components[c].data[8 * d + 4 * h + i]);
                      entry.sum[i] += add;
                      entry.magnitude[i] += std::fabs(add);
                    }
                    if (p == q) entry.own += w * double(in.components[c].data[8 * d + 4 * h + 3]);
                  }
              }
          }
        }
    }
  return result;
}

}  // namespace fathom::reference
