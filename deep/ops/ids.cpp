// Source: the Cryptomatte specification 1.2.0 (Psyop), sections on the metadata, on ranked channels and on the
// conversion of hashes to floats; MurmurHash3 x86 32 by Austin Appleby, public domain, for the key of the metadata.
#include "deep/ops/ids.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/channels.h"
#include "deep/flat_attributes.h"
#include "deep/row_weights.h"
#include "flat/attribute_text.h"

namespace fathom::deep {

namespace {

constexpr int kRows = 8;  // of a tile; its scratch is allocated once

std::span<const uint32_t> idsOf(const DeepImage& image, const std::string& name) {
  const Channel* channel = image.find(name);
  if (channel && channel->type == PixelType::Uint) return channel->ids;
  std::string found;
  for (const Channel& c : image.channels)
    if (c.type == PixelType::Uint) found += (found.empty() ? "" : ", ") + c.name;
  fail("channel {}: expected ids (UINT), found {}; channels with ids: {}", name,
       channel ? "a channel of another type" : "no such channel", found.empty() ? "none" : found);
}

flat::Image emptyResult(const DeepImage& image) {
  return {image.dataWindow, image.displayWindow, {}, flatAttributes(image.attributes)};
}

// Calls body(pixel, samples, seen) for every pixel that is not empty: `samples` are the numbers of its first sample and
// of the one behind its last, `seen` their effective alphas. make() makes a body with its scratch.
template <class Make>
void forEachPixel(const DeepImage& image, const Make& make) {
  const size_t width = size_t(image.dataWindow.width());
  (void)RowCompositor(image);  // throws for images without rows, too
  parallelRanges(0, image.dataWindow.height(), kRows, [&](int y0, int y1) {
    RowCompositor compositor(image);
    auto body = make();
    for (size_t first = size_t(y0) * width; first < size_t(y1) * width; first += width) {
      const double* seen = compositor.composite(first, first + width).seen.data();
      for (size_t pixel = first; pixel < first + width; ++pixel) {
        const size_t begin = image.offsets[pixel], count = image.count(pixel);
        if (count > 0) body(pixel, begin, std::span(seen + (begin - image.offsets[first]), count));
      }
    }
  });
}

struct Coverage {
  uint32_t id;
  double coverage;
};

// The ids of one pixel that are seen, by falling coverage.
void rank(std::span<const uint32_t> ids, std::span<const double> seen, std::vector<Coverage>& ranked) {
  ranked.clear();
  for (size_t i = 0; i < ids.size(); ++i)
    if (seen[i] > 0) ranked.push_back({ids[i], seen[i]});
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  size_t last = 0;
  for (size_t i = 1; i < ranked.size(); ++i)
    if (ranked[i].id == ranked[last].id)
      ranked[last].coverage += ranked[i].coverage;
    else
      ranked[++last] = ranked[i];
  if (!ranked.empty()) ranked.resize(last + 1);
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.coverage > b.coverage; });
}

uint32_t murmur3(std::string_view text) {
  const auto scramble = [](uint32_t k) { return std::rotl(k * 0xcc9e2d51u, 15) * 0x1b873593u; };
  uint32_t hash = 0, block = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    block |= uint32_t(uint8_t(text[i])) << (8 * (i % 4));
    if (i % 4 != 3) continue;
    hash = std::rotl(hash ^ scramble(block), 13) * 5 + 0xe6546b64u;
    block = 0;
  }
  hash ^= scramble(block) ^ uint32_t(text.size());
  hash = (hash ^ hash >> 16) * 0x85ebca6bu;
  hash = (hash ^ hash >> 13) * 0xc2b2ae35u;
  return hash ^ hash >> 16;
}

void describe(const std::string& layer, std::map<std::string, std::string>& attributes) {
  const std::string key = fmt::format("cryptomatte/{}/", fmt::format("{:08x}", murmur3(layer)).substr(0, 7));
  std::erase_if(attributes,
                [&](const auto& a) { return a.first.starts_with("cryptomatte/") && !a.first.starts_with(key); });
  attributes[key + "name"] = flat::attributeText(layer);
  attributes[key + "hash"] = "MurmurHash3_32";
  attributes[key + "conversion"] = "uint32_to_float32";
}

}  // namespace

uint32_t cryptomatteBits(uint32_t id) {
  const uint32_t exponent = id >> 23 & 255;
  return exponent == 0 || exponent == 255 ? id ^ 1u << 23 : id;
}

flat::Image idMattes(const DeepImage& image, const std::string& channel, std::span<const uint32_t> values) {
  const std::span<const uint32_t> ids = idsOf(image, channel);
  std::vector<uint32_t> wanted(values.begin(), values.end());
  std::ranges::sort(wanted);
  wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  flat::Image result = emptyResult(image);
  for (const uint32_t value : wanted) result.add(fmt::format("{}.{}", channel, value));
  forEachPixel(image, [&] {
    return [&, sums = std::vector<double>(wanted.size())](size_t pixel, size_t first,
                                                          std::span<const double> seen) mutable {
      std::ranges::fill(sums, 0.0);
      for (size_t i = 0; i < seen.size(); ++i) {
        const auto found = std::ranges::lower_bound(wanted, ids[first + i]);
        if (found != wanted.end() && *found == ids[first + i]) sums[size_t(found - wanted.begin())] += seen[i];
      }
      for (size_t k = 0; k < sums.size(); ++k) result.planes[k].values[pixel] = float(sums[k]);
    };
  });
  return result;
}

flat::Image idMatte(const DeepImage& image, const std::string& channel, std::span<const uint32_t> values) {
  const std::span<const uint32_t> ids = idsOf(image, channel);
  std::vector<uint32_t> wanted(values.begin(), values.end());
  std::ranges::sort(wanted);
  flat::Image result = emptyResult(image);
  Buffer<float>& matte = result.add("A").values;
  forEachPixel(image, [&] {
    return [&](size_t pixel, size_t first, std::span<const double> seen) {
      double sum = 0;
      for (size_t i = 0; i < seen.size(); ++i)
        if (std::ranges::binary_search(wanted, ids[first + i])) sum += seen[i];
      matte[pixel] = float(sum);
    };
  });
  return result;
}

RankedIds rankIds(const DeepImage& image, const std::string& channel, int ranks) {
  if (ranks < 1 || ranks > 200) fail("ranks: expected 1 to 200, found {}", ranks);
  const std::span<const uint32_t> ids = idsOf(image, channel);
  RankedIds result{emptyResult(image)};
  for (int layer = 0; layer < (ranks + 1) / 2; ++layer)
    for (const char* part : {"R", "G", "B", "A"}) result.image.add(fmt::format("{}{:02}.{}", channel, layer, part));
  describe(channel, result.image.attributes);
  std::vector<flat::Plane>& planes = result.image.planes;
  std::vector<size_t> most(size_t(image.dataWindow.height()));
  const size_t width = size_t(image.dataWindow.width());
  forEachPixel(image, [&] {
    return [&, ranked = std::vector<Coverage>()](size_t pixel, size_t first, std::span<const double> seen) mutable {
      rank(ids.subspan(first, seen.size()), seen, ranked);
      most[pixel / width] = std::max(most[pixel / width], ranked.size());
      for (size_t k = 0; k < std::min(ranked.size(), planes.size() / 2); ++k) {
        planes[2 * k].values[pixel] = std::bit_cast<float>(cryptomatteBits(ranked[k].id));
        planes[2 * k + 1].values[pixel] = float(ranked[k].coverage);
      }
    };
  });
  for (const size_t count : most) result.most = std::max(result.most, count);
  return result;
}

}  // namespace fathom::deep
