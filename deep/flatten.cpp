// Which sample contributes how much to a pixel is decided once per row of the image; the channels are then sums over
// that.
#include "deep/flatten.h"

#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "deep/channels.h"
#include "deep/volume.h"
#include "flat/parallel.h"

namespace fathom::deep {

namespace {

struct Contribution {
  size_t sample;
  double premultiplied;  // factor of premultiplied values: the transmittance in front of the sample
  double plain;          // factor of other values: the sample's part of the pixel's alpha
};

struct RowGeometry {
  std::vector<Contribution> contributions;
  std::vector<size_t> first;  // per pixel, its first contribution; one more at the end
  std::vector<float> alpha, z;
};

float middle(float z, float zBack) {
  return zBack > z && std::isfinite(zBack) ? float((double(z) + double(zBack)) / 2) : z;
}

// One pixel appended to the row.
void decide(const DeepImage& image, std::span<const float> alpha, std::span<const float> z,
            std::span<const float> zBack, size_t pixel, RowGeometry& row) {
  const size_t first = row.contributions.size();
  double passed = 1, opaque = 0, depth = 0;
  float nearest = std::numeric_limits<float>::infinity();
  for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i) {
    const double a = opacity(alpha[i]);
    const float mid = zBack.empty() ? z[i] : middle(z[i], zBack[i]);
    nearest = std::min(nearest, z[i]);
    opaque += passed * a;
    if (a > 0 && passed > 0) depth += passed * a * double(mid);
    row.contributions.push_back({i, passed, passed * a});
    passed *= 1 - a;
  }
  for (size_t k = first; k < row.contributions.size(); ++k)
    row.contributions[k].plain = opaque > 0 ? row.contributions[k].plain / opaque : 0;
  row.first.push_back(row.contributions.size());
  row.alpha.push_back(float(opaque));
  row.z.push_back(row.contributions.size() == first ? 0.0f : opaque > 0 ? float(depth / opaque) : nearest);
}

template <double Contribution::*factor>
void apply(const RowGeometry& row, std::span<const float> values, std::span<float> out) {
  for (size_t x = 0; x < out.size(); ++x) {
    double sum = 0;
    for (size_t k = row.first[x]; k < row.first[x + 1]; ++k)
      sum += row.contributions[k].*factor * double(finiteOrZero(values[row.contributions[k].sample]));
    out[x] = float(sum);
  }
}

std::map<std::string, std::string> flatAttributes(const Attributes& attributes) {
  std::map<std::string, std::string> result;
  const auto& header = attributes.header();
  for (auto it = header.begin(); it != header.end(); ++it) {
    const Imf::Attribute& a = it.attribute();
    if (const auto* i = dynamic_cast<const Imf::IntAttribute*>(&a)) result[it.name()] = fmt::format("{}", i->value());
    if (const auto* f = dynamic_cast<const Imf::FloatAttribute*>(&a)) result[it.name()] = fmt::format("{}", f->value());
    if (const auto* s = dynamic_cast<const Imf::StringAttribute*>(&a)) result[it.name()] = s->value();
    if (const auto* m = dynamic_cast<const Imf::M44fAttribute*>(&a)) {
      const float* v = m->value().getValue();
      result[it.name()] = fmt::format("{}", fmt::join(v, v + 16, ", "));
    }
  }
  for (const char* stale : {"name", "type"}) result.erase(stale);
  return result;
}

}  // namespace

flat::Image flatten(const DeepImage& image) {
  const std::span<const float> alpha = image.get("A"), z = image.get("Z"), zBack = image.tryGet("ZBack");
  flat::Image result{image.dataWindow, image.displayWindow, {}, flatAttributes(image.attributes)};
  std::vector<const Channel*> sources;
  for (const Channel& channel : image.channels) {
    const Role role = roleOf(channel);
    if (role == Role::Statistic || role == Role::Identifier || channel.name == "ZBack") continue;
    sources.push_back(&channel);
    result.add(channel.name);
  }
  const size_t width = size_t(image.dataWindow.width());
  parallelFor(0, image.dataWindow.height(), [&](int y) {
    RowGeometry row;
    row.first.push_back(0);
    for (size_t x = 0; x < width; ++x) decide(image, alpha, z, zBack, size_t(y) * width + x, row);
    for (size_t c = 0; c < sources.size(); ++c) {
      const std::span<float> out{result.planes[c].values.data() + size_t(y) * width, width};
      switch (roleOf(*sources[c])) {
        case Role::Alpha:
          std::copy(row.alpha.begin(), row.alpha.end(), out.begin());
          break;
        case Role::Depth:
          std::copy(row.z.begin(), row.z.end(), out.begin());
          break;
        case Role::Plain:
          apply<&Contribution::plain>(row, sources[c]->values, out);
          break;
        default:
          apply<&Contribution::premultiplied>(row, sources[c]->values, out);
      }
    }
  });
  return result;
}

}  // namespace fathom::deep
