// A flat EXR written row by row: scanlines, ZIP, one part. On our own codec (flat/exr_codec), four times as fast as
// OpenEXR's and with no more than some rows in memory.
#pragma once

#include <memory>
#include <string>

#include "flat/image.h"
#include "flat/io.h"

namespace fathom::flat {

// The file stands at `path` only after finish().
class ExrWriter {
 public:
  // `layout` gives names, display window and attributes (its values are not read), `dataWindow` all of the rows. Throws
  // Error where there is nothing to write, a name is there twice, or the file cannot be made.
  ExrWriter(const std::string& path, const Image& layout, const Box& dataWindow, const WriteOptions& options = {});
  ExrWriter(ExrWriter&&) noexcept;
  ~ExrWriter();

  // The next rows below those already written, with the planes of the layout in its order.
  void write(const Image& rows);
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fathom::flat
