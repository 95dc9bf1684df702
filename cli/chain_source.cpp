#include "cli/chain_source.h"

#include <algorithm>

#include "deep/ops/crop.h"
#include "flat/exr_size.h"
#include "flat/io.h"

namespace fathom::cli {

namespace {

constexpr int kRowsCountedAtOnce = 64;

// Whether the part that is asked for is deep: where none is, whether any is.
bool isDeep(const std::string& path, const std::string& part) {
  if (!flat::isExr(path)) return false;
  const std::vector<deep::PartInfo> parts = deep::readParts(path);
  return std::ranges::any_of(parts, [&](const deep::PartInfo& p) {
    return p.deep && (part.empty() || part == p.name || part == std::to_string(p.number));
  });
}

flat::Image toWindow(const flat::Image& image, const Box& window) {
  flat::Image result{window, image.displayWindow, {}, image.attributes};
  const Box common = intersect(image.dataWindow, window);
  for (const flat::Plane& plane : image.planes) {
    flat::Plane& to = result.add(plane.name);
    for (int y = common.y0; y < common.y1 && common.width() > 0; ++y)
      std::copy_n(plane.values.data() + image.dataWindow.index(common.x0, y), common.width(),
                  to.values.data() + window.index(common.x0, y));
  }
  return result;
}

}  // namespace

ChainSource::ChainSource(const std::string& path, const std::string& part, size_t memoryLimit,
                         const deep::ChannelFilter& channels)
    : path_(path) {
  if (isDeep(path, part)) {
    reader_ = std::make_unique<deep::Reader>(path, deep::ReadOptions{part, channels, memoryLimit});
    window_ = reader_->part().dataWindow;
    countSamples();
  } else {
    flat_ = flat::read(path, {.part = part, .memoryLimit = memoryLimit});
    window_ = flat_.dataWindow;
  }
}

void ChainSource::countSamples() {
  const double perSample = 4.0 * double(reader_->part().channels.size());
  const size_t width = size_t(window_.width());
  bytesAbove_.push_back(0);
  for (int y0 = window_.y0; y0 < window_.y1; y0 += kRowsCountedAtOnce) {
    const int y1 = std::min(window_.y1, y0 + kRowsCountedAtOnce);
    const Buffer<uint32_t> counts = reader_->sampleCounts(y0, y1);
    for (int y = y0; y < y1; ++y) {
      double bytes = 8.0 * double(width);
      for (size_t x = 0; x < width; ++x) bytes += perSample * double(counts[size_t(y - y0) * width + x]);
      bytesAbove_.push_back(bytesAbove_.back() + bytes);
    }
  }
}

AnyImage ChainSource::form() {
  return read(window_.y0, window_.y0);
}

AnyImage ChainSource::read(int y0, int y1) {
  if (reader_) return reader_->read(y0, y1);
  return toWindow(flat_, {window_.x0, y0, window_.x1, y1});
}

double ChainSource::decodedBytes(int y0, int y1) const {
  if (!reader_ || y1 <= y0) return 0;
  return bytesAbove_[size_t(y1 - window_.y0)] - bytesAbove_[size_t(y0 - window_.y0)];
}

AnyImage rowsOf(const AnyImage& image, int y0, int y1) {
  if (const auto* deep = std::get_if<deep::DeepImage>(&image)) return deep::rows(*deep, y0, y1);
  const auto& flat = std::get<flat::Image>(image);
  return toWindow(flat, {flat.dataWindow.x0, y0, flat.dataWindow.x1, y1});
}

AnyImage toWindow(AnyImage image, const Box& window) {
  if (dataWindowOf(image) == window) return image;
  if (const auto* deep = std::get_if<deep::DeepImage>(&image)) return deep::toWindow(*deep, window);
  return toWindow(std::get<flat::Image>(image), window);
}

}  // namespace fathom::cli
