#include "nn/metadata.h"

#include <algorithm>

#include "base/error.h"

namespace fathom::nn {

namespace {

constexpr int kMostWidth = 256;

}  // namespace

const std::string& metadata(const WeightFile& file, const std::string& key) {
  const auto found = file.metadata.find(key);
  if (found == file.metadata.end()) fail("{}: metadata {} is missing", file.name, key);
  return found->second;
}

void expectMetadata(const WeightFile& file, const std::string& key, const std::string& expected) {
  const std::string& found = metadata(file, key);
  if (found != expected)
    fail("{}, metadata {}: expected {}, found {}", file.name, key, expected, printable(found.substr(0, 60)));
}

int widthOf(const WeightFile& file) {
  const std::string& text = metadata(file, "width");
  int width = 0;
  if (text.size() <= 3 && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; }))
    for (const char c : text) width = 10 * width + (c - '0');
  if (width <= 0 || width > kMostWidth || width % 16 != 0)
    fail("{}, metadata width: expected a multiple of 16 up to {}, found {}", file.name, kMostWidth,
         printable(text.substr(0, 60)));
  return width;
}

}  // namespace fathom::nn
