#include "deep/guide.h"

#include <cmath>
#include <numeric>

#include "base/parallel.h"
#include "deep/still.h"

namespace fathom::deep {

namespace {

// Gaussian of sigma 0.5 over three pixels; further ones weigh less than 4e-4.
constexpr float kSide = 0.10650697891920f, kMiddle = 1 - 2 * kSide;

// The part of the 5x5 mean that a variance does not fall below, see prefilterVariance.
constexpr float kPooled = 0.5f;

// Mean over 5x5 pixels of an extended plane, into `out`.
void mean5x5(const flat::Padded& in, flat::Padded& out, int width, int height) {
  flat::Padded across(width, height, 2);
  parallelFor(0, height, [&](int y) {
    const float* r = in.row(y);
    float* o = across.row(y);
    for (int x = 0; x < width; ++x) o[x] = 0.04f * (r[x - 2] + r[x - 1] + r[x] + r[x + 1] + r[x + 2]);
  });
  across.extend();
  parallelFor(0, height, [&](int y) {
    const float *a = across.row(y - 2), *b = across.row(y - 1), *c = across.row(y), *d = across.row(y + 1),
                *e = across.row(y + 2);
    float* o = out.row(y);
    for (int x = 0; x < width; ++x) o[x] = a[x] + b[x] + c[x] + d[x] + e[x];
  });
}

// Where nothing tells the noise: the residual against the mean of two neighbours, those beside or those above and
// below, whichever is smaller, so that an edge is not taken for noise. The expectation of its square is 0.788 of the
// variance where the image is smooth and the noise normal. Averaged over 5x5 pixels.
void estimateVariance(const flat::Padded& value, flat::Padded& variance, int width, int height) {
  flat::Padded residual(width, height, 2);
  parallelFor(0, height, [&](int y) {
    const float *above = value.row(y - 1), *in = value.row(y), *below = value.row(y + 1);
    for (int x = 0; x < width; ++x) {
      const float across = in[x] - 0.5f * (in[x - 1] + in[x + 1]), down = in[x] - 0.5f * (above[x] + below[x]);
      residual.row(y)[x] = std::min(across * across, down * down) / 0.788f;
    }
  });
  residual.extend();
  mean5x5(residual, variance, width, height);
}

void flattenBlock(const DenoiseData& data, const float* values, int block, Guide& guide) {
  parallelFor(0, data.height, [&](int y) {
    const uint64_t* offsets = data.offsets + size_t(y) * size_t(data.width);
    for (int x = 0; x < data.width; ++x) {
      float sum[3] = {0, 0, 0};
      for (uint64_t b = offsets[x]; b < offsets[x + 1]; ++b)
        for (size_t c = 0; c < 3; ++c) sum[c] += values[8 * b + 4 * size_t(block) + c];
      for (size_t c = 0; c < 3; ++c) guide.value[c].row(y)[x] = sum[c];
    }
  });
}

// The sum of weight^2 times the bins' variance.
float varianceOfPixel(const DenoiseData& data, const Buffer<float>& variance, size_t pixel) {
  float sum = 0;
  for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b)
    sum += data.weight[b] * data.weight[b] * variance[b];
  return sum;
}

void flattenVariance(const DenoiseData& data, const Buffer<float>& variance, flat::Padded& out) {
  parallelFor(0, data.height, [&](int y) {
    const size_t row = size_t(y) * size_t(data.width);
    for (int x = 0; x < data.width; ++x) out.row(y)[x] = varianceOfPixel(data, variance, row + size_t(x));
  });
}

// The mean of a feature over a pixel's bins, and their alpha; 0 and 0 where there is none.
struct Mean {
  float value = 0, weight = 0;
};

Mean flattenPixel(const DenoiseData& data, const Buffer<float>& values, size_t pixel) {
  Mean mean;
  for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
    mean.value += data.weight[b] * values[b];
    mean.weight += data.weight[b];
  }
  mean.value = mean.weight > 0 ? mean.value / mean.weight : 0;
  return mean;
}

}  // namespace

void prefilterVariance(flat::Padded& variance, int width, int height) {
  variance.extend();
  flat::Padded across(width, height, 1), blurred(width, height, 1), pooled(width, height, 0);
  parallelFor(0, height, [&](int y) {
    const float* in = variance.row(y);
    float* out = across.row(y);
    for (int x = 0; x < width; ++x) out[x] = kMiddle * in[x] + kSide * (in[x - 1] + in[x + 1]);
  });
  across.extend();
  parallelFor(0, height, [&](int y) {
    const float *above = across.row(y - 1), *in = across.row(y), *below = across.row(y + 1);
    float* out = blurred.row(y);
    for (int x = 0; x < width; ++x) out[x] = kMiddle * in[x] + kSide * (above[x] + below[x]);
  });
  mean5x5(variance, pooled, width, height);
  parallelFor(0, height, [&](int y) {
    float* v = variance.row(y);
    const float *b = blurred.row(y), *p = pooled.row(y);
    for (int x = 0; x < width; ++x) v[x] = std::max(std::max(v[x], b[x]), kPooled * p[x]);
  });
  variance.extend();
}

ComponentGuide colourGuide(const DenoiseData& data, const DenoiseComponent& component, int pad) {
  ComponentGuide guide;
  for (size_t c = 0; c < 3; ++c) {
    for (int h = 0; h < 2; ++h) guide.value[size_t(h)].value[c] = flat::Padded(data.width, data.height, pad);
    guide.variance.value[c] = flat::Padded(data.width, data.height, pad);
  }
  for (int h = 0; h < 2; ++h) flattenBlock(data, component.data.data(), data.halves ? h : 0, guide.value[size_t(h)]);
  for (size_t c = 0; c < 3; ++c) {
    flat::Padded &first = guide.value[0].value[c], &second = guide.value[1].value[c],
                 &variance = guide.variance.value[c];
    first.extend();
    second.extend();
    if (data.halves) {
      // Of one half: twice the two-buffer variance of the mean.
      parallelFor(0, data.height, [&](int y) {
        for (int x = 0; x < data.width; ++x) {
          const float e = first.row(y)[x] - second.row(y)[x];
          variance.row(y)[x] = 0.5f * e * e;
        }
      });
    } else if (!component.variance.empty()) {
      flattenVariance(data, component.variance[c], variance);
    } else {
      estimateVariance(first, variance, data.width, data.height);
    }
    prefilterVariance(variance, data.width, data.height);
  }
  return guide;
}

FeatureGuide featureGuide(const DenoiseData& data, const Feature& feature, int pad, const Buffer<uint8_t>& skip) {
  FeatureGuide guide;
  for (size_t c = 0; c < 3; ++c) {
    const size_t from = std::min(c, feature.value.size() - 1);
    flat::Padded& value = guide.value.value[c] = flat::Padded(data.width, data.height, pad);
    flat::Padded& variance = guide.variance.value[c] = flat::Padded(data.width, data.height, pad);
    parallelFor(0, data.height, [&](int y) {
      const size_t row = size_t(y) * size_t(data.width);
      for (int x = 0; x < data.width; ++x) {
        const size_t pixel = row + size_t(x);
        const Mean mean = skip[pixel] ? Mean() : flattenPixel(data, feature.value[from], pixel);
        value.row(y)[x] = mean.value;
        variance.row(y)[x] =
            mean.weight > 0 ? varianceOfPixel(data, feature.variance[from], pixel) / (mean.weight * mean.weight) : 0;
      }
    });
    value.extend();
    variance.extend();
  }
  return guide;
}

std::vector<Buffer<float>> squaredGradients(const DenoiseData& data, const Feature& feature,
                                            const Buffer<uint8_t>& skip) {
  std::vector<Buffer<float>> result;
  const Buffer<uint8_t> unread = allWithin(skip, data.width, data.height, 1);
  flat::Padded value(data.width, data.height, 1), weight(data.width, data.height, 1);
  for (const Buffer<float>& channel : feature.value) {
    parallelFor(0, data.height, [&](int y) {
      const size_t row = size_t(y) * size_t(data.width);
      for (int x = 0; x < data.width; ++x) {
        const Mean mean = unread[row + size_t(x)] ? Mean() : flattenPixel(data, channel, row + size_t(x));
        value.row(y)[x] = mean.value;
        weight.row(y)[x] = mean.weight;
      }
    });
    value.extend();
    weight.extend();
    Buffer<float>& gradient = result.emplace_back(size_t(data.width) * size_t(data.height));
    parallelFor(0, data.height, [&](int y) {
      const size_t row = size_t(y) * size_t(data.width);
      for (int x = 0; x < data.width; ++x) {
        // A pixel that sees nothing has no value: the feature is taken to go on as it is.
        const auto at = [&](int dx, int dy) {
          return weight.row(y + dy)[x + dx] > 0 ? value.row(y + dy)[x + dx] : value.row(y)[x];
        };
        const float gx = 0.5f * (at(1, 0) - at(-1, 0)), gy = 0.5f * (at(0, 1) - at(0, -1));
        gradient[row + size_t(x)] = skip[row + size_t(x)] ? 0 : gx * gx + gy * gy;
      }
    });
  }
  return result;
}

}  // namespace fathom::deep
