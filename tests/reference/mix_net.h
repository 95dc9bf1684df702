// The mixing network in double precision, as its training describes it, and random weights for it.
#pragma once

#include "nn/mix.h"
#include "tests/reference/layers.h"

namespace fathom::reference {

struct MixTwinLogits {
  std::vector<Volume> weight;
  Volume share;
};

inline Volume scaled(const Volume& x, double factor) {
  return mapped(x, [factor](double v) { return factor * v; });
}

inline MixTwinLogits mixTwin(const PlainWeights& w, const std::vector<Volume>& own, const Volume& shared) {
  const auto meanOf = [](const std::vector<Volume>& all) {
    Volume sum = all[0];
    for (size_t n = 1; n < all.size(); ++n) sum = plus(sum, all[n]);
    return scaled(sum, 1.0 / double(all.size()));
  };
  const Volume mean = meanOf(own);
  std::vector<Volume> features;
  for (const Volume& x : own) {
    const Volume planes = concat(concat(x, plus(x, scaled(mean, -1))), shared);
    const Volume x0 = relu(convolve(w, "in", planes));
    const Volume d0 = relu(convolve(w, "down0", x0, 2)), x1 = relu(plus(d0, convolve(w, "level1", d0)));
    const Volume d1 = relu(convolve(w, "down1", x1, 2)), x2 = relu(plus(d1, convolve(w, "level2", d1)));
    const Volume y1 = relu(plus(convolve(w, "merge1", x1), upsample(convolve(w, "up1", x2))));
    features.push_back(relu(plus(convolve(w, "merge0", x0), upsample(convolve(w, "up0", y1)))));
  }
  const Volume context = meanOf(features);
  MixTwinLogits result;
  for (const Volume& f : features)
    result.weight.push_back(convolve(w, "weight", relu(plus(convolve(w, "own", f), convolve(w, "context", context)))));
  result.share = convolve(w, "share", relu(convolve(w, "shareContext", context)));
  return result;
}

inline PlainWeights randomMix(uint32_t seed) {
  PlainWeights result;
  result.metadata = {{"format", "fathom-mix"}, {"version", "1"}, {"name", "random"}};
  RandomConvolutions conv(result, seed);
  conv("in", 2 * nn::kMixOwn + nn::kMixShared, 16, 1);
  conv("down0", 16, 32, 2);
  conv("level1", 32, 32, 3);
  conv("down1", 32, 32, 2);
  conv("level2", 32, 32, 3);
  conv("up1", 32, 32, 1);
  conv("merge1", 32, 32, 1, false);
  conv("up0", 32, 16, 1);
  conv("merge0", 16, 16, 3, false);
  conv("own", 16, 16, 1, false);
  conv("context", 16, 16, 1);
  conv("weight", 16, 1, 1);
  conv("shareContext", 16, 16, 1);
  conv("share", 16, 1, 1);
  return result;
}

}  // namespace fathom::reference
