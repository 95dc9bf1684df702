#include "cli/chain_sink.h"

#include <algorithm>

#include "base/error.h"
#include "cli/chain_run.h"
#include "cli/chain_source.h"
#include "deep/channels.h"
#include "flat/io.h"
#include "flat/tonemap.h"

namespace fathom::cli {

namespace {

// Depths and statistics need the range of FLOAT; identifiers stay what they are.
void storeAsHalf(deep::DeepImage& image) {
  for (deep::Channel& channel : image.channels) {
    const deep::Role role = deep::roleOf(channel);
    if (role == deep::Role::Alpha || role == deep::Role::Premultiplied || role == deep::Role::Half)
      channel.type = deep::PixelType::Half;
  }
}

void toDisplay(flat::Image& image) {
  for (flat::Plane& plane : image.planes)
    if (plane.name == "R" || plane.name == "G" || plane.name == "B" || plane.name == "Y")
      for (float& value : plane.values) value = float(flat::srgb(double(value)));
}

}  // namespace

ChainSink::ChainSink(ChainSinkParams params, const AnyImage& form, const Box& window) : params_(std::move(params)) {
  Box dataWindow = window;
  if (window.empty()) {  // an EXR has a pixel at least
    dataWindow = {window.x0, window.y0, window.x0 + 1, window.y0 + 1};
    onlyPixel_ = toWindow(rowsOf(form, dataWindowOf(form).y0, dataWindowOf(form).y0), dataWindow);
  }
  const bool png = params_.path.ends_with(".png");
  if (const auto* deep = std::get_if<deep::DeepImage>(&form)) {
    if (png) fail("{}: expected a flat image for a PNG, found a deep one; --flatten comes first", params_.path);
    deep::DeepImage layout = deep->copy();
    if (params_.half) storeAsHalf(layout);
    if (!params_.madeBy.empty()) layout.attributes.set(kChainMadeBy, params_.madeBy);
    deep_.emplace(params_.path, layout, dataWindow, params_.options);
    return;
  }
  const auto& flat = std::get<flat::Image>(form);
  picture_ = {dataWindow, flat.displayWindow, {}, flat.attributes};
  if (!params_.madeBy.empty()) picture_.attributes[kChainMadeBy] = params_.madeBy;
  for (const flat::Plane& plane : flat.planes)
    picture_.planes.push_back({plane.name, Buffer<float>(png ? dataWindow.area() : 0)});
  if (!png) flat_.emplace(params_.path, picture_, dataWindow, flat::WriteOptions{params_.half});
}

void ChainSink::write(AnyImage rows) {
  if (deep_) {
    if (params_.half) storeAsHalf(deepOf(rows));
    return deep_->write(deepOf(rows));
  }
  const flat::Image& image = flatOf(rows);
  if (flat_) return flat_->write(image);
  const size_t first = picture_.dataWindow.index(image.dataWindow.x0, image.dataWindow.y0);
  for (size_t c = 0; c < picture_.planes.size(); ++c)
    std::ranges::copy(image.planes[c].values, picture_.planes[c].values.begin() + first);
}

void ChainSink::finish() {
  if (onlyPixel_) write(std::move(*onlyPixel_));
  if (deep_) return deep_->finish();
  if (flat_) return flat_->finish();
  toDisplay(picture_);
  flat::writePng(params_.path, picture_);
}

}  // namespace fathom::cli
