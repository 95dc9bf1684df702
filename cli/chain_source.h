// An image that a chain begins with, deep or flat, read by rows.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cli/operation.h"
#include "deep/io.h"

namespace fathom::cli {

class ChainSource {
 public:
  // `part`: number or name; empty: the first deep part, or else the first. A flat image is read whole here.
  // `channels`: of a deep one, those that are read; empty: all.
  ChainSource(const std::string& path, const std::string& part, size_t memoryLimit,
              const deep::ChannelFilter& channels = {});

  const std::string& path() const { return path_; }
  const Box& dataWindow() const { return window_; }
  // The part of a deep file; null for a flat one.
  const deep::PartInfo* part() const { return reader_ ? &reader_->part() : nullptr; }
  AnyImage form();
  // Rows [y0, y1) within the data window.
  AnyImage read(int y0, int y1);
  // Bytes that those rows take decoded; 0 for a flat image, which is there already.
  double decodedBytes(int y0, int y1) const;

 private:
  void countSamples();

  std::string path_;
  std::unique_ptr<deep::Reader> reader_;
  flat::Image flat_;
  Box window_;
  std::vector<double> bytesAbove_;  // of the rows above each row, and of all
};

// Rows [y0, y1) of an image; all within its data window.
AnyImage rowsOf(const AnyImage& image, int y0, int y1);
// The image on another data window: what was outside of the old one is empty, or 0.
AnyImage toWindow(AnyImage image, const Box& window);

}  // namespace fathom::cli
