#include "deep/still.h"

#include <cmath>

#include "flat/parallel.h"

namespace fathom::deep {

namespace {

constexpr float kVisible = 1e-3f;  // of a colour: deviations below are not seen
constexpr float kDark = 0.05f;     // of the frame's mean colour: darker ones count as that

// Whether the variance of the mean of one flattened channel is below what can be seen.
bool quiet(float variance, float colour, float level) {
  const float scale = kVisible * std::max(std::fabs(colour), kDark * level);
  return variance <= scale * scale;
}

// From the guides: the variance of half a frame is twice that of the frame.
bool quietGuides(std::span<const ComponentGuide> guides, bool halves, int x, int y, float level) {
  for (const ComponentGuide& guide : guides)
    for (size_t c = 0; c < 3; ++c)
      if (!quiet((halves ? 0.5f : 1.0f) * guide.variance.value[c].row(y)[x], guide.value[0].value[c].row(y)[x], level))
        return false;
  return true;
}

// From the file's own variances, which chance does not make 0 as easily as the difference of two halves.
bool quietBins(const DenoiseData& data, const std::array<std::span<const float>, 3>& variance,
               std::span<const ComponentGuide> guides, size_t pixel, int x, int y, float level) {
  for (size_t c = 0; c < 3; ++c) {
    float sum = 0, colour = 0;
    for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b)
      sum += data.weight[b] * data.weight[b] * variance[c][b];
    for (const ComponentGuide& guide : guides) colour += guide.value[0].value[c].row(y)[x];
    if (!quiet(sum, colour, level)) return false;
  }
  return true;
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

Activity findActivity(const DenoiseData& data, std::span<const ComponentGuide> guides, const DeepImage& image,
                      const DenoiseInputs& inputs, int radius, float level) {
  const size_t width = size_t(data.width), pixels = width * size_t(data.height);
  Activity activity{Buffer<uint8_t>(pixels), Buffer<uint8_t>(pixels)};
  std::array<std::span<const float>, 3> variance;
  if (inputs.variance) variance = {image.get("variance.R"), image.get("variance.G"), image.get("variance.B")};
  Buffer<uint8_t> calm(pixels), across(pixels);
  parallelFor(0, data.height, [&](int y) {
    for (int x = 0; x < data.width; ++x) {
      const size_t pixel = size_t(y) * width + size_t(x);
      calm[pixel] = quietGuides(guides, data.halves, x, y, level) &&
                    (!inputs.variance || quietBins(data, variance, guides, pixel, x, y, level));
      activity.light[pixel] = 0;
      for (size_t c = 0; c < data.components.size(); ++c)
        for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
          const float* v = data.components[c].data.data() + 8 * b;
          // A sample that is not finite says nothing here and asks for the filter all the same.
          const bool dumb = !(v[3] + v[7] > 0) && data.weight[b] > 0;
          if (dumb) calm[pixel] = 0;
          if (dumb || v[0] != 0 || v[1] != 0 || v[2] != 0 || v[4] != 0 || v[5] != 0 || v[6] != 0)
            activity.light[pixel] = uint8_t(activity.light[pixel] | 1u << c);
        }
    }
    erode(calm.data() + size_t(y) * width, across.data() + size_t(y) * width, data.width, 1, radius);
  });
  parallelFor(0, data.width,
              [&](int x) { erode(across.data() + x, activity.still.data() + x, data.height, width, radius); });
  parallelFor(0, data.height, [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel)
      if (data.offsets[pixel] == data.offsets[pixel + 1]) activity.still[pixel] = 1;
  });
  return activity;
}

unsigned activeComponents(const DenoiseData& data, const Activity& activity, const Box& tile, int radius) {
  bool any = false;
  for (int y = tile.y0; y < tile.y1 && !any; ++y)
    for (int x = tile.x0; x < tile.x1 && !any; ++x) any = !activity.still[size_t(y) * size_t(data.width) + size_t(x)];
  if (!any) return 0;
  const Box reach = intersect({tile.x0 - radius, tile.y0 - radius, tile.x1 + radius, tile.y1 + radius},
                              {0, 0, data.width, data.height});
  unsigned light = 0;
  for (int y = reach.y0; y < reach.y1; ++y)
    for (int x = reach.x0; x < reach.x1; ++x) light |= activity.light[size_t(y) * size_t(data.width) + size_t(x)];
  return light;
}

}  // namespace fathom::deep
