// A file that a chain writes, deep or flat, band after band.
#pragma once

#include <optional>
#include <string>

#include "cli/operation.h"
#include "deep/io.h"
#include "flat/exr_writer.h"

namespace fathom::cli {

struct ChainSinkParams {
  std::string path;  // .exr, or .png for a flat image: shown with the sRGB curve
  bool half = false;
  std::string madeBy;          // see ChainRunParams
  deep::WriteOptions options;  // of a deep file
};

// The file appears with finish(), whole.
class ChainSink {
 public:
  // `form`: the image without rows; `window`: the data window of all of it. Where that is empty, the file has a pixel
  // without samples, or of 0, at its corner.
  ChainSink(ChainSinkParams params, const AnyImage& form, const Box& window);

  // The next rows below those already written.
  void write(AnyImage rows);
  void finish();

 private:
  ChainSinkParams params_;
  std::optional<deep::Writer> deep_;
  std::optional<flat::ExrWriter> flat_;
  flat::Image picture_;  // of a PNG, gathered here
  std::optional<AnyImage> onlyPixel_;
};

}  // namespace fathom::cli
