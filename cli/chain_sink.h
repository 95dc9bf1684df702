// A file that a chain writes, deep or flat, band after band.
#pragma once

#include <optional>
#include <string>

#include "cli/operation.h"
#include "deep/io.h"

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
  // `form`: the image without rows; `dataWindow`: of all of it.
  ChainSink(ChainSinkParams params, const AnyImage& form, const Box& dataWindow);

  // The next rows below those already written.
  void write(AnyImage rows);
  void finish();

 private:
  ChainSinkParams params_;
  std::optional<deep::Writer> writer_;
  flat::Image flat_;
};

}  // namespace fathom::cli
