// The compositional denoiser in double precision, as its description reads, and random weights for it.
#pragma once

#include "tests/reference/layers.h"

namespace fathom::reference {

class CompositionalTwin {
 public:
  explicit CompositionalTwin(const PlainWeights& weights) : weights_(weights) {}

  Volume denoise(const Volume& planes, const Volume& colour, int components) const {
    const Volume f = block("encoder.block", relu(convolve(weights_, "encoder.in", planes)));
    return node(colour, f, components);
  }

 private:
  struct Levels {
    Volume y0, y1, x2;
  };

  Volume block(const std::string& name, const Volume& x) const {
    return relu(plus(convolve(weights_, name + ".1", relu(convolve(weights_, name + ".0", x))), x));
  }

  Levels unet(const std::string& p, const Volume& c, const Volume& f) const {
    const Volume logarithm = mapped(c, [](double v) { return std::log1p(v); });
    const Volume x =
        relu(plus(convolve(weights_, p + ".in.features", f), convolve(weights_, p + ".in.colour", logarithm)));
    const Volume x0 = block(p + ".level0", x);
    const Volume x1 = block(p + ".level1", relu(convolve(weights_, p + ".down0", x0, 2)));
    const Volume x2 = block(p + ".level2", relu(convolve(weights_, p + ".down1", x1, 2)));
    const Volume y1 = relu(convolve(weights_, p + ".merge1", concat(upsample(convolve(weights_, p + ".up1", x2)), x1)));
    const Volume y0 = relu(convolve(weights_, p + ".merge0", concat(upsample(convolve(weights_, p + ".up0", y1)), x0)));
    return {y0, y1, x2};
  }

  Volume node(const Volume& c, const Volume& f, int components) const {
    if (components == 1) return leaf(c, f);
    const Volume y0 = unet("decompose", c, f).y0;
    const Volume m = sigmoid(convolve(weights_, "decompose.mask", y0));
    Volume c0 = c, c1 = c;
    for (size_t i = 0; i < c.values.size(); ++i) {
      c0.values[i] = m.values[i] * c.values[i];
      c1.values[i] = (1 - m.values[i]) * c.values[i];
    }
    return plus(node(c0, block("decompose.first", y0), components / 2),
                node(c1, block("decompose.second", y0), components / 2));
  }

  Volume leaf(const Volume& c, const Volume& f) const {
    const Levels levels = unet("denoise", c, f);
    const Volume k0 = convolve(weights_, "denoise.kernel0", levels.y0);
    const Volume k1 = convolve(weights_, "denoise.kernel1", levels.y1);
    const Volume k2 = convolve(weights_, "denoise.kernel2", levels.x2);
    const Volume c1 = halve(c), c2 = halve(c1);
    const Volume r1 = addCoarse(filterColour(k1, c1), sigmoid(channel(k1, 25)), filterColour(k2, c2));
    return addCoarse(filterColour(k0, c), sigmoid(channel(k0, 25)), r1);
  }

  const PlainWeights& weights_;
};

inline PlainWeights randomCompositional(int w, uint32_t seed) {
  PlainWeights result;
  result.metadata = {{"format", "fathom-compositional"},
                     {"version", "2"},
                     {"inputs", "24"},
                     {"width", std::to_string(w)},
                     {"name", "random"}};
  RandomConvolutions conv(result, seed);
  const auto block = [&](const std::string& name, int n) {
    conv(name + ".0", n, n, 3);
    conv(name + ".1", n, n, 3);
  };
  conv("encoder.in", 24, w, 3);
  block("encoder.block", w);
  for (const std::string p : {"decompose", "denoise"}) {
    conv(p + ".in.features", w, w, 3);
    conv(p + ".in.colour", 3, w, 3, false);
    block(p + ".level0", w);
    conv(p + ".down0", w, 2 * w, 2);
    block(p + ".level1", 2 * w);
    conv(p + ".down1", 2 * w, 4 * w, 2);
    block(p + ".level2", 4 * w);
    conv(p + ".up1", 4 * w, 2 * w, 1);
    conv(p + ".merge1", 4 * w, 2 * w, 3);
    conv(p + ".up0", 2 * w, w, 1);
    conv(p + ".merge0", 2 * w, w, 3);
  }
  conv("decompose.mask", w, 3, 1);
  block("decompose.first", w);
  block("decompose.second", w);
  conv("denoise.kernel0", w, 26, 1);
  conv("denoise.kernel1", 2 * w, 26, 1);
  conv("denoise.kernel2", 4 * w, 25, 1);
  return result;
}

}  // namespace fathom::reference
