// The layered denoiser in double precision, as its description reads, random weights for it, and random samples.
#pragma once

#include "nn/layers.h"
#include "tests/reference/layers.h"

namespace fathom::reference {

// A sample as the network takes it: its weight is the 17th input.
struct PlainSample {
  std::vector<double> inputs;  // 20
  double colour[6] = {};       // exposed, not premultiplied: diffuse and specular light
  double depth = 0;

  double weight() const { return inputs[16]; }
};

// Samples of the pixels of a frame, row by row.
struct PlainSamples {
  int height = 0, width = 0;
  std::vector<std::vector<PlainSample>> pixels;

  PlainSamples(int h, int w) : height(h), width(w), pixels(size_t(h) * size_t(w)) {}
  std::vector<PlainSample>& at(int y, int x) { return pixels[size_t(y) * size_t(width) + size_t(x)]; }
  const std::vector<PlainSample>& at(int y, int x) const { return pixels[size_t(y) * size_t(width) + size_t(x)]; }
};

struct LayeredResult {
  std::vector<Volume> layers;               // 5 channels each: R, G, B, alpha, depth times alpha
  Volume flat;                              // R, G, B, alpha
  std::vector<std::vector<double>> shares;  // of each sample in their order, in all layers
};

class LayeredTwin {
 public:
  explicit LayeredTwin(const PlainWeights& weights) : weights_(weights) {}

  // Sides are multiples of 4. Lights one after the other, in the layers of the first.
  LayeredResult denoise(const PlainSamples& samples, int layers,
                        const std::vector<nn::SampleLight>& lights = {nn::SampleLight::Both}) const {
    LayeredResult result = denoiseOne(samples, layers, lights[0], nullptr);
    for (size_t i = 1; i < lights.size(); ++i) {
      const LayeredResult other = denoiseOne(samples, layers, lights[i], &result.shares);
      for (size_t l = 0; l < result.layers.size(); ++l)
        for (size_t k = 0; k < result.layers[l].values.size(); ++k)
          result.layers[l].values[k] += other.layers[l].values[k];
    }
    for (Volume& layer : result.layers)
      for (size_t k = 3 * size_t(layer.height) * size_t(layer.width); k < layer.values.size(); ++k)
        layer.values[k] /= double(lights.size());
    result.flat = composited(result.layers);
    return result;
  }

 private:
  LayeredResult denoiseOne(const PlainSamples& samples, int layers, nn::SampleLight light,
                           const std::vector<std::vector<double>>* shares) const {
    if (light == nn::SampleLight::Both) return filteredTogether(samples, layers, false, shares);
    if (light == nn::SampleLight::Specular)
      return filteredTogether(with(samples, {0, 1, 2, 17}, {0, 1, 2}), layers, false, shares);
    return filteredTogether(with(samples, {3, 4, 5, 18}, {3, 4, 5}), layers, true, shares);
  }

  // Samples of which some inputs and some colours are nothing.
  static PlainSamples with(PlainSamples samples, const std::vector<size_t>& inputs,
                           const std::vector<size_t>& colours) {
    for (std::vector<PlainSample>& pixel : samples.pixels)
      for (PlainSample& sample : pixel) {
        for (const size_t i : inputs) sample.inputs[i] = 0;
        for (const size_t c : colours) sample.colour[c] = 0;
      }
    return samples;
  }

  // divided: by the albedo inputs and 0.1, of which the layers' light gets the mean back, but no more than there was before.
  LayeredResult filteredTogether(const PlainSamples& samples, int layers, bool divided,
                                 const std::vector<std::vector<double>>* given) const {
    const int height = samples.height, width = samples.width;
    Volume mean(32, height, width);
    std::vector<std::vector<std::vector<double>>> embeddings(samples.pixels.size());
    forPixels(samples, [&](int y, int x, size_t pixel) {
      for (const PlainSample& sample : samples.pixels[pixel]) {
        std::vector<double> e = sample.inputs;
        for (const char* name : {"reducer.0", "reducer.1", "reducer.2"}) e = rectified(dense(name, e));
        for (int c = 0; c < 32; ++c) mean.at(c, y, x) += sample.weight() * e[size_t(c)];
        embeddings[pixel].push_back(std::move(e));
      }
    });
    const std::vector<Volume> context = unet(mean);
    const Volume partition = convolve(weights_, "partition.context", context[0]);
    LayeredResult result;
    std::vector<Volume> sums, embedding;  // R, G, B, w, n, Z, divisors, light before; E
    for (int l = 0; l < layers; ++l) sums.emplace_back(12, height, width), embedding.emplace_back(32, height, width);
    forPixels(samples, [&](int y, int x, size_t pixel) {
      for (size_t s = 0; s < samples.pixels[pixel].size(); ++s) {
        const PlainSample& sample = samples.pixels[pixel][s];
        std::vector<double> h = dense("partition.embedding", embeddings[pixel][s]);
        for (int c = 0; c < 32; ++c) h[size_t(c)] += partition.at(c, y, x);
        const std::vector<double> q =
            given ? (*given)[result.shares.size()]
                  : shares(dense("partition.2", rectified(dense("partition.1", rectified(std::move(h))))), layers);
        for (int l = 0; l < layers; ++l) {
          const double w = sample.weight() * q[size_t(l)];
          for (int c = 0; c < 3; ++c) sums[size_t(l)].at(c, y, x) += w * (sample.colour[c] + sample.colour[3 + c]);
          sums[size_t(l)].at(3, y, x) += w;
          sums[size_t(l)].at(5, y, x) += w * sample.depth;
          for (int c = 0; c < 3; ++c) {
            const double by = divided ? sample.inputs[size_t(6 + c)] + 0.1 : 1;
            sums[size_t(l)].at(6 + c, y, x) += w * by;
            sums[size_t(l)].at(9 + c, y, x) += w * by * (sample.colour[c] + sample.colour[3 + c]);
          }
          for (int c = 0; c < 32; ++c) embedding[size_t(l)].at(c, y, x) += w * embeddings[pixel][s][size_t(c)];
        }
        result.shares.push_back(q);
      }
      double all = 0;
      for (const Volume& layer : sums) all += layer.at(3, y, x);
      double reaching = std::max(0.0, 1 - all);  // what misses all layers
      for (size_t l = sums.size(); l-- > 0;) sums[l].at(4, y, x) = reaching += sums[l].at(3, y, x);
    });
    for (int l = 0; l < layers; ++l) result.layers.push_back(filtered(sums[size_t(l)], embedding[size_t(l)], context));
    result.flat = composited(result.layers);
    return result;
  }

  template <class Body>
  static void forPixels(const PlainSamples& samples, const Body& body) {
    for (int y = 0; y < samples.height; ++y)
      for (int x = 0; x < samples.width; ++x) body(y, x, size_t(y) * size_t(samples.width) + size_t(x));
  }

  static std::vector<double> rectified(std::vector<double> v) {
    for (double& x : v) x = std::max(x, 0.0);
    return v;
  }

  std::vector<double> dense(const std::string& name, const std::vector<double>& in) const {
    Volume column(int(in.size()), 1, 1);
    column.values = in;
    return convolve(weights_, name, column).values;
  }

  static std::vector<double> shares(const std::vector<double>& logits, int layers) {
    std::vector<double> q(logits.begin(), logits.begin() + layers);
    if (layers == 1) return {1};
    double most = q[0], total = 0, rest = 0;
    for (const double v : q) most = std::max(most, v);
    for (double& v : q) total += v = std::exp(v - most);
    for (double& v : q) rest += v = std::max(v / total - 0.01, 0.0);
    for (double& v : q) v /= rest;
    return q;
  }

  Volume block(const std::string& name, const Volume& x) const {
    return relu(plus(convolve(weights_, name + ".1", relu(convolve(weights_, name + ".0", x))), x));
  }

  std::vector<Volume> unet(const Volume& mean) const {
    const Volume x0 = block("unet.level0", relu(convolve(weights_, "unet.in", mean)));
    const Volume x1 = block("unet.level1", relu(convolve(weights_, "unet.down0", x0, 2)));
    const Volume x2 = block("unet.level2", relu(convolve(weights_, "unet.down1", x1, 2)));
    const Volume y1 = relu(convolve(weights_, "unet.merge1", concat(upsample(convolve(weights_, "unet.up1", x2)), x1)));
    const Volume y0 = relu(convolve(weights_, "unet.merge0", concat(upsample(convolve(weights_, "unet.up0", y1)), x0)));
    return {y0, y1, x2};
  }

  Volume filtered(const Volume& sums, const Volume& embedding, const std::vector<Volume>& context) const {
    Volume values = sums, e = embedding, result(11, sums.height, sums.width), lambda;
    for (int i = 0; i < 3; ++i) {
      const std::string name = "kernel" + std::to_string(i);
      const Volume first = relu(
          plus(convolve(weights_, name + ".embedding", e), convolve(weights_, name + ".context", context[size_t(i)])));
      const Volume logits = convolve(weights_, name + ".2", relu(convolve(weights_, name + ".1", first)));
      if (i == 0) lambda = scaleShares(logits);
      Volume out = splatted(logits, values);
      for (int k = 0; k < i; ++k) out = enlarge(out);
      for (int c = 0; c < 11; ++c)
        for (int y = 0; y < out.height; ++y)
          for (int x = 0; x < out.width; ++x) result.at(c, y, x) += lambda.at(i, y, x) * out.at(c, y, x);
      values = halve(values);
      e = halve(e);
    }
    for (int c = 0; c < 3; ++c)
      for (int y = 0; y < sums.height; ++y)
        for (int x = 0; x < sums.width; ++x) {
          const double around = std::max(result.at(5 + c, y, x) / std::max(result.at(3, y, x), 1e-12), 0.1);
          const double light = std::min(result.at(c, y, x), result.at(8 + c, y, x) / around);
          result.at(c, y, x) = light * (sums.at(6 + c, y, x) + 0.125 * around) / (sums.at(3, y, x) + 0.125);
        }
    result.values.resize(5 * size_t(sums.height) * size_t(sums.width));
    result.channels = 5;
    return result;
  }

  static Volume scaleShares(const Volume& logits) {
    Volume out(3, logits.height, logits.width);
    for (int y = 0; y < out.height; ++y)
      for (int x = 0; x < out.width; ++x) {
        double most = -1e300, total = 0;
        for (int i = 0; i < 3; ++i) most = std::max(most, logits.at(25 + i, y, x));
        for (int i = 0; i < 3; ++i) total += out.at(i, y, x) = std::exp(logits.at(25 + i, y, x) - most);
        for (int i = 0; i < 3; ++i) out.at(i, y, x) /= total;
      }
    return out;
  }

  static Volume composited(const std::vector<Volume>& layers) {
    Volume out(4, layers[0].height, layers[0].width);
    for (int y = 0; y < out.height; ++y)
      for (int x = 0; x < out.width; ++x) {
        double passed = 1;
        for (const Volume& layer : layers) {
          for (int c = 0; c < 3; ++c) out.at(c, y, x) += passed * layer.at(c, y, x);
          passed *= 1 - layer.at(3, y, x);
        }
        out.at(3, y, x) = 1 - passed;
      }
    return out;
  }

  const PlainWeights& weights_;
};

inline PlainWeights randomLayered(int w, uint32_t seed) {
  PlainWeights result;
  result.metadata = {{"format", "fathom-layers"},  {"version", "1"},  {"inputs", "20"}, {"embedding", "32"},
                     {"width", std::to_string(w)}, {"name", "random"}};
  RandomConvolutions conv(result, seed);
  conv("reducer.0", 20, 32, 1);
  conv("reducer.1", 32, 32, 1);
  conv("reducer.2", 32, 32, 1);
  conv("unet.in", 32, w, 3);
  for (int i = 0; i < 3; ++i)
    for (const char* part : {".0", ".1"}) conv("unet.level" + std::to_string(i) + part, w << i, w << i, 3);
  conv("unet.down0", w, 2 * w, 2);
  conv("unet.down1", 2 * w, 4 * w, 2);
  conv("unet.up1", 4 * w, 2 * w, 1);
  conv("unet.merge1", 4 * w, 2 * w, 3);
  conv("unet.up0", 2 * w, w, 1);
  conv("unet.merge0", 2 * w, w, 3);
  conv("partition.context", w, 32, 1);
  conv("partition.embedding", 32, 32, 1, false);
  conv("partition.1", 32, 16, 1);
  conv("partition.2", 16, 4, 1);
  for (int i = 0; i < 3; ++i) {
    const std::string name = "kernel" + std::to_string(i);
    conv(name + ".context", w << i, 32, 1);
    conv(name + ".embedding", 32, 32, 1, false);
    conv(name + ".1", 32, 32, 1);
    conv(name + ".2", 32, i ? 25 : 28, 1);
  }
  return result;
}

// Between none and `most` samples a pixel; their weights sum to at most 1, and to 1 in one pixel of two.
inline PlainSamples randomSamples(int height, int width, size_t most, uint32_t seed) {
  std::mt19937 generator(seed);
  const auto uniform = [&] { return double(generator()) / 4294967296.0; };
  PlainSamples result(height, width);
  for (std::vector<PlainSample>& pixel : result.pixels) {
    pixel.resize(generator() % (most + 1));
    const bool opaque = generator() % 2;
    double passed = 1;
    for (size_t i = 0; i < pixel.size(); ++i) {
      PlainSample& sample = pixel[i];
      for (int k = 0; k < 20; ++k) sample.inputs.push_back(double(float(2 * uniform() - 1)));
      const double alpha = opaque && i + 1 == pixel.size() ? 1 : 0.05 + 0.9 * uniform();
      sample.inputs[16] = double(float(passed * alpha));
      passed *= 1 - alpha;
      for (double& c : sample.colour) c = double(float(4 * uniform() * uniform()));
      sample.depth = double(float(1 + 9 * uniform()));
    }
  }
  return result;
}

}  // namespace fathom::reference
