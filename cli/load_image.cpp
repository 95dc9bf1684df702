#include "cli/load_image.h"

#include <algorithm>

#include "flat/exr_size.h"
#include "flat/io.h"

namespace fathom::cli {

namespace {

bool hasDeepPart(const std::string& path) {
  return flat::isExr(path) && std::ranges::any_of(deep::readParts(path), &deep::PartInfo::deep);
}

}  // namespace

AnyImage loadImage(const std::string& path, const deep::ChannelFilter& needed) {
  if (!hasDeepPart(path)) return flat::read(path);
  const auto filter = [&](const std::string& name) {
    return name == "A" || name == "Z" || name == "ZBack" || needed(name);
  };
  return deep::read(path, {.part = {}, .channels = filter});
}

}  // namespace fathom::cli
