// Images from files, deep or flat as the file is.
#pragma once

#include <string>
#include <variant>

#include "deep/image.h"
#include "deep/io.h"
#include "flat/image.h"

namespace fathom::cli {

using AnyImage = std::variant<deep::DeepImage, flat::Image>;

// The first deep part of a file, or else the first flat part. Of a deep one only the channels that `needed` names, and
// A, Z and ZBack, are unpacked.
AnyImage loadImage(const std::string& path, const deep::ChannelFilter& needed);

}  // namespace fathom::cli
