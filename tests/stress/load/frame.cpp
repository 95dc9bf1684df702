// Writes a frame of any size, a few rows at a time: stress_frame OUT WIDTH HEIGHT SAMPLES.
//
// One deep sample for each camera sample, as a renderer leaves them (`*.samples.exr`): a wall, a fence before it whose bars
// leave it in sight within pixels, and noise of sixteen values, so that a frame of ten gigabytes packs well.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>

#include "base/parallel.h"
#include "deep/io.h"

namespace fathom {
namespace {

constexpr int kBandRows = 16;

uint32_t hashOf(uint32_t x, uint32_t y, uint32_t k) {
  uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ k * 0xc2b2ae3du;
  h = (h ^ h >> 15) * 0x2c1b3c6du;
  return h ^ h >> 13;
}

struct Frame {
  int width, height, samples;

  deep::DeepImage rows(int y0, int y1) const {
    deep::DeepImage band{{0, y0, width, y1}, {0, 0, width, height}, {}, {}, {}};
    band.offsets = Buffer<uint64_t>(band.dataWindow.area() + 1);
    for (size_t p = 0; p <= band.dataWindow.area(); ++p) band.offsets[p] = p * size_t(samples);
    deep::Channel* channels[5];
    const char* names[] = {"R", "G", "B", "A", "Z"};
    band.channels.reserve(5);
    for (int c = 0; c < 5; ++c)
      channels[c] = &band.add(names[c], c >= 3 ? deep::PixelType::Float : deep::PixelType::Half);
    parallelFor(y0, y1, [&](int y) {
      for (int x = 0; x < width; ++x) fillPixel(channels, band.dataWindow.index(x, y) * size_t(samples), x, y);
    });
    return band;
  }

  // The first `inFront` samples lie on the fence, which covers that share of the pixel.
  void fillPixel(deep::Channel* const* channels, size_t first, int x, int y) const {
    const int strip = y / 64;
    const int inFront = x / 8 % 8 == 0 ? samples : x / 8 % 8 == 1 ? samples / 3 : 0;
    float depth = 0;
    for (int k = 0; k < samples; ++k) {
      const bool fence = k < inFront;
      if (k == 0 || k == inFront) depth = fence ? 4.0f : 20.0f + float(strip) / 64;
      const float alpha = 1.0f / float(samples - k);
      const float light = float(hashOf(uint32_t(x), uint32_t(y), uint32_t(k)) % 16) / 8;
      const float shade = fence ? 0.75f : 0.25f + 0.125f * float((x / 256 + y / 256) % 4);
      for (int c = 0; c < 3; ++c)
        channels[c]->values[first + size_t(k)] = alpha * shade * light * (1 - 0.25f * float(c));
      channels[3]->values[first + size_t(k)] = alpha;
      channels[4]->values[first + size_t(k)] = depth;
      depth = std::nextafter(depth, 1e9f);  // samples of one depth would be taken for one
    }
  }
};

void writeFrame(const std::string& path, const Frame& frame) {
  deep::DeepImage layout = frame.rows(0, 0);
  layout.attributes.set("fathom:spp", frame.samples);
  layout.attributes.set("fathom:ppuScale", float(frame.width));
  deep::Writer writer(path, layout, {0, 0, frame.width, frame.height});
  for (int y = 0; y < frame.height; y += kBandRows) writer.write(frame.rows(y, std::min(y + kBandRows, frame.height)));
  writer.finish();
}

}  // namespace
}  // namespace fathom

int main(int argc, char** argv) {
  try {
    if (argc != 5) return std::fprintf(stderr, "usage: %s OUT WIDTH HEIGHT SAMPLES\n", argv[0]), 2;
    fathom::writeFrame(argv[1], {std::stoi(argv[2]), std::stoi(argv[3]), std::stoi(argv[4])});
    return 0;
  } catch (const std::exception& e) {
    return std::fprintf(stderr, "%s: %s\n", argv[0], e.what()), 1;
  }
}
