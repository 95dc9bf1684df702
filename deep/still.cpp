#include "deep/still.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/parallel.h"

namespace fathom::deep {

namespace {

constexpr float kVisible = 1e-3f;  // of a colour: deviations below are not seen
constexpr float kDark = 0.05f;     // of the frame's mean colour: darker ones count as that

// Whether the variance of the mean of one flattened channel is below what can be seen.
bool quiet(float variance, float colour, float level) {
  const float scale = kVisible * std::max(std::fabs(colour), kDark * level);
  return variance <= scale * scale;
}

// Two means of nothing differ by nothing: what bins of one camera sample say is believed where most of the pixel's
// other samples agree.
constexpr float kLeastKnown = 0.5f;

// From the image itself, where nothing else tells: see guide.
bool quietGuides(std::span<const ComponentGuide> guides, int x, int y, float level) {
  for (const ComponentGuide& guide : guides)
    for (size_t c = 0; c < 3; ++c)
      if (!quiet(guide.variance.value[c].row(y)[x], guide.value[0].value[c].row(y)[x], level)) return false;
  return true;
}

// What the bins of a pixel tell of its noise, and how much of the pixel they are. That the halves see more or less of a
// bin is no noise of any bin's colour.
struct PixelNoise {
  std::array<float, 3> variance{}, colour{};
  float known = 0, all = 0;

  bool quiet(float level) const {
    for (size_t c = 0; c < 3; ++c)
      if (!deep::quiet(variance[c], colour[c], level)) return false;
    return known >= kLeastKnown * all;
  }
};

PixelNoise noiseOfHalves(const DenoiseData& data, const DenoiseComponent& component, size_t pixel) {
  PixelNoise noise;
  for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
    const float* v = component.data.data() + 8 * b;
    noise.all += data.weight[b];
    if (!(v[3] > 0) || !(v[7] > 0)) continue;
    noise.known += data.weight[b];
    const float scale = data.weight[b] * data.weight[b] * v[3] * v[7] / ((v[3] + v[7]) * (v[3] + v[7]));
    for (size_t c = 0; c < 3; ++c) {
      const float e = v[c] / v[3] - v[4 + c] / v[7];
      noise.variance[c] += scale * e * e;
      noise.colour[c] += 0.5f * (v[c] + v[4 + c]);
    }
  }
  return noise;
}

// What the file itself says; spans are empty where it has no variances.
struct FileNoise {
  std::array<std::span<const float>, 3> variance, colour;
  std::span<const float> alpha;
};

// From the file's own variances, which chance does not make 0 as easily as the difference of two halves.
PixelNoise noiseOfFile(const DenoiseData& data, const FileNoise& file, size_t pixel) {
  PixelNoise noise;
  for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
    const float w = data.weight[b];
    noise.all += w;
    if (data.count[b] > 1) noise.known += w;
    for (size_t c = 0; c < 3 && w > 0; ++c) {
      noise.variance[c] += w * w * file.variance[c][b];
      noise.colour[c] += w / file.alpha[b] * file.colour[c][b];
    }
  }
  return noise;
}

std::vector<std::span<const float>> allColours(const DeepImage& image) {
  std::vector<std::span<const float>> colours;
  for (const char* prefix : {"", "diffuse.", "specular."})
    for (const char* letter : {"R", "G", "B"})
      if (const auto values = image.tryGet(prefix + std::string(letter)); !values.empty()) colours.push_back(values);
  return colours;
}

// Without colour, and no camera sample counts for it.
bool isBlank(const DenoiseData& data, const std::vector<std::span<const float>>& colours, size_t pixel) {
  for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b)
    if (data.count[b] > 0 || std::ranges::any_of(colours, [&](const auto& values) { return values[b] != 0; }))
      return false;
  return true;
}

// A sample that is not finite says nothing here and asks for the filter all the same.
bool isDumb(const DenoiseData& data, const DenoiseComponent& component, size_t b) {
  const float* v = component.data.data() + 8 * b;
  return !(v[3] + v[7] > 0) && data.weight[b] > 0;
}

bool hasDumb(const DenoiseData& data, size_t pixel) {
  for (const DenoiseComponent& component : data.components)
    for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b)
      if (isDumb(data, component, b)) return true;
  return false;
}

Box around(const DenoiseData& data, const Box& tile, int reach) {
  return intersect({tile.x0 - reach, tile.y0 - reach, tile.x1 + reach, tile.y1 + reach},
                   {0, 0, data.width, data.height});
}

// dst[i] = all of src within radius (windows end at the ends), along one direction with the given step.
void erode(const uint8_t* src, uint8_t* dst, int count, size_t step, int radius) {
  int lastBad = -radius - 1;
  for (int i = 0; i < std::min(radius, count); ++i)
    if (!src[size_t(i) * step]) lastBad = i;
  for (int i = 0; i < count; ++i) {
    if (i + radius < count && !src[size_t(i + radius) * step]) lastBad = i + radius;
    dst[size_t(i) * step] = lastBad < i - radius;
  }
}

}  // namespace

Buffer<uint8_t> allWithin(const Buffer<uint8_t>& flags, int width, int height, int radius) {
  const size_t stride = size_t(width);
  Buffer<uint8_t> across(flags.size()), result(flags.size());
  parallelFor(0, height, [&](int y) {
    erode(flags.data() + size_t(y) * stride, across.data() + size_t(y) * stride, width, 1, radius);
  });
  parallelFor(0, width, [&](int x) { erode(across.data() + x, result.data() + x, height, stride, radius); });
  return result;
}

Buffer<uint8_t> calmPixels(const DenoiseData& data, std::span<const ComponentGuide> guides, const DeepImage& image,
                           const DenoiseInputs& inputs, float level) {
  FileNoise file;
  if (inputs.variance) {
    file.variance = {image.get("variance.R"), image.get("variance.G"), image.get("variance.B")};
    file.colour = {image.get("R"), image.get("G"), image.get("B")};
    file.alpha = image.get("A");
  }
  const auto isQuiet = [&](size_t pixel, int x, int y) {
    for (size_t c = 0; c < data.components.size() && data.halves; ++c)
      if (!noiseOfHalves(data, data.components[c], pixel).quiet(level)) return false;
    if (inputs.variance) return noiseOfFile(data, file, pixel).quiet(level);
    return data.halves || quietGuides(guides, x, y, level);
  };
  const std::vector<std::span<const float>> colours = allColours(image);
  const size_t width = size_t(data.width);
  Buffer<uint8_t> calm(width * size_t(data.height));
  parallelFor(0, data.height, [&](int y) {
    for (int x = 0; x < data.width; ++x) {
      const size_t pixel = size_t(y) * width + size_t(x);
      calm[pixel] = isBlank(data, colours, pixel) || (!hasDumb(data, pixel) && isQuiet(pixel, x, y));
    }
  });
  return calm;
}

Activity findActivity(const DenoiseData& data, std::span<const ComponentGuide> guides, const DeepImage& image,
                      const DenoiseInputs& inputs, int radius, float level) {
  const size_t width = size_t(data.width), pixels = width * size_t(data.height);
  Activity activity{allWithin(calmPixels(data, guides, image, inputs, level), data.width, data.height, radius),
                    Buffer<uint8_t>(pixels, 0)};
  const std::vector<std::span<const float>> colours = allColours(image);
  parallelFor(0, data.height, [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel) {
      if (data.offsets[pixel] == data.offsets[pixel + 1]) activity.still[pixel] = 1;
      for (size_t c = 0; c < data.components.size(); ++c)
        for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
          const float* v = data.components[c].data.data() + 8 * b;
          const bool lit = v[0] != 0 || v[1] != 0 || v[2] != 0 || v[4] != 0 || v[5] != 0 || v[6] != 0;
          if (lit || (isDumb(data, data.components[c], b) && !isBlank(data, colours, pixel)))
            activity.light[pixel] = uint8_t(activity.light[pixel] | 1u << c);
        }
    }
  });
  return activity;
}

bool activeNear(const DenoiseData& data, const Activity& activity, const Box& tile, int reach) {
  const Box box = around(data, tile, reach);
  for (int y = box.y0; y < box.y1; ++y)
    for (int x = box.x0; x < box.x1; ++x)
      if (!activity.still[size_t(y) * size_t(data.width) + size_t(x)]) return true;
  return false;
}

unsigned activeComponents(const DenoiseData& data, const Activity& activity, const Box& tile, int radius) {
  if (!activeNear(data, activity, tile, 0)) return 0;
  const Box reach = around(data, tile, radius);
  unsigned light = 0;
  for (int y = reach.y0; y < reach.y1; ++y)
    for (int x = reach.x0; x < reach.x1; ++x) light |= activity.light[size_t(y) * size_t(data.width) + size_t(x)];
  return light;
}

}  // namespace fathom::deep
