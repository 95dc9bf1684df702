// Source: "The PLY Polygon File Format" (Turk, 1994).
#include "deep/ops/points.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/ppu_scale.h"
#include "deep/view_rays.h"
#include "deep/volume.h"
#include "flat/tonemap.h"

namespace fathom::deep {

namespace {

static_assert(std::endian::native == std::endian::little);  // as the files are

// Attributes of a camera that stands at the world's origin and looks along its z.
Attributes atOrigin(const DeepImage& image, std::optional<float> fieldOfView) {
  Attributes attributes = image.attributes;
  if (!fieldOfView) attributes.set("fathom:ppuScale", findPpuScale(image.attributes, image.displayWindow));
  attributes.erase("worldToNDC");
  attributes.set("worldToCamera", std::array<float, 16>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  return attributes;
}

std::array<ViewRays, 3> raysOf(const DeepImage& image, const PointsParams& params) {
  if (params.fieldOfView && !(*params.fieldOfView > 0 && *params.fieldOfView < 180))
    fail("fov: expected degrees between 0 and 180, found {}", *params.fieldOfView);
  if (params.world && !hasWorldSpace(image))
    fail("expected the attribute worldToCamera, with an inverse, for world space; found none");
  if (!ViewRays(image.attributes, image.displayWindow, params.fieldOfView, Axis::X).hasScale())
    fail("expected fov, or one of the attributes worldToNDC, fieldOfView, fathom:ppuScale, found none");
  const Attributes attributes = params.world ? image.attributes : atOrigin(image, params.fieldOfView);
  const auto along = [&](Axis axis) { return ViewRays(attributes, image.displayWindow, params.fieldOfView, axis); };
  return {along(Axis::X), along(Axis::Y), along(Axis::Z)};
}

// Without a pattern that would line up with the pixels.
bool isTaken(int x, int y, size_t sample, int every) {
  uint64_t bits = (uint64_t(uint32_t(x)) << 32 | uint32_t(y)) * 0x9e3779b97f4a7c15u + sample;
  bits = (bits ^ bits >> 32) * 0xd6e8feb86659fd93u;
  bits = (bits ^ bits >> 32) * 0xd6e8feb86659fd93u;
  return (bits >> 32) % uint64_t(every) == 0;
}

struct Source {
  std::span<const float> alpha, z, zBack;
  std::array<std::span<const float>, 3> colour;

  explicit Source(const DeepImage& image)
      : alpha(image.get("A")),
        z(image.get("Z")),
        zBack(image.tryGet("ZBack")),
        colour{image.tryGet("R"), image.tryGet("G"), image.tryGet("B")} {}
};

// Of a value in [0,1].
uint8_t toByte(double value) {
  return uint8_t(std::lround(value * 255));
}

struct Point {
  std::array<float, 3> place;
  std::array<uint8_t, 4> colour;
};
static_assert(sizeof(Point) == kPlyPointBytes);

Point pointOf(const Source& source, size_t sample, double depth, const std::array<ViewRay, 3>& rays) {
  const double alpha = opacity(source.alpha[sample]);
  Point point{};
  for (size_t c = 0; c < 3; ++c) {
    point.place[c] = float(rays[c].start + depth * rays[c].slope);
    const double value = source.colour[c].empty() ? alpha : double(finiteOrZero(source.colour[c][sample]));
    point.colour[c] = toByte(flat::srgb(alpha > 0 ? value / alpha : value));
  }
  point.colour[3] = toByte(alpha);
  return point;
}

std::vector<Point> rowPoints(const DeepImage& image, const Source& source, const std::array<ViewRays, 3>& rays,
                             const PointsParams& params, int y) {
  std::vector<Point> points;
  for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x) {
    const size_t pixel = image.dataWindow.index(x, y), begin = size_t(image.offsets[pixel]);
    const std::array<ViewRay, 3> here = {rays[0].at(x, y), rays[1].at(x, y), rays[2].at(x, y)};
    for (size_t s = begin; s < image.offsets[pixel + 1]; ++s) {
      const double depth = usableRange(source.z[s], source.zBack.empty() ? source.z[s] : source.zBack[s]).middle();
      if (opacity(source.alpha[s]) < double(params.leastAlpha) || !std::isfinite(depth)) continue;
      if (isTaken(x, y, s - begin, params.every)) points.push_back(pointOf(source, s, depth, here));
    }
  }
  return points;
}

}  // namespace

bool hasWorldSpace(const DeepImage& image) {
  return ViewRays(image.attributes, image.displayWindow, {}, Axis::X).hasPlace();
}

std::vector<uint8_t> plyPoints(const DeepImage& image, const PointsParams& params) {
  if (params.every < 1) fail("every: expected at least 1, found {}", params.every);
  const Source source(image);
  const std::array<ViewRays, 3> rays = raysOf(image, params);
  std::vector<std::vector<Point>> rows(size_t(image.dataWindow.height()));
  parallelFor(0, image.dataWindow.height(),
              [&](int y) { rows[size_t(y)] = rowPoints(image, source, rays, params, image.dataWindow.y0 + y); });
  std::vector<uint8_t> bytes;
  for (const std::vector<Point>& row : rows) {
    const size_t at = bytes.size();
    bytes.resize(at + row.size() * kPlyPointBytes);
    if (!row.empty()) std::memcpy(bytes.data() + at, row.data(), row.size() * kPlyPointBytes);
  }
  return bytes;
}

std::string plyHeader(uint64_t points) {
  std::string count = fmt::format("element vertex {}\n", points);
  // What is left of the place for the largest number becomes a comment.
  constexpr size_t kCountBytes = 64;
  count += "comment " + std::string(kCountBytes - count.size() - 9, '-') + "\n";
  return "ply\nformat binary_little_endian 1.0\n" + count +
         "property float x\nproperty float y\nproperty float z\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\nend_header\n";
}

}  // namespace fathom::deep
