// Weight files in the safetensors format: named tensors and strings about them.
//
// The format: 8 bytes with the length of a JSON header (little-endian), the header, then the tensors' bytes, which follow
// one another without gaps to the end of the file. A header's entry is "name": {"dtype", "shape", "data_offsets"}, or
// "__metadata__" with strings.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/buffer.h"

namespace fathom::nn {

struct Tensor {
  std::vector<int64_t> shape;
  Buffer<float> values;  // row-major, finite; F16 and BF16 are converted on the way in
};

// "16x24x3x3", or "scalar".
std::string shapeText(std::span<const int64_t> shape);

struct WeightFile {
  std::string name;  // as errors call it
  std::map<std::string, Tensor> tensors;
  std::map<std::string, std::string> metadata;
};

// Throws an Error that names the file, the tensor, what was expected and what was found, for anything else than a whole
// and plain file of finite numbers: at most 1 MiB of header, 4096 tensors and 1 GiB of data.
WeightFile readWeights(const std::string& path);
WeightFile readWeights(std::span<const std::byte> bytes, const std::string& name);

// Hands out the tensors of a file, each to the layer that expects it, and tells those that no layer took.
class WeightSource {
 public:
  // The file must outlive this.
  explicit WeightSource(const WeightFile& file) : file_(file) {}

  // Throws an Error where the tensor is missing or has another shape.
  const Tensor& take(const std::string& name, const std::vector<int64_t>& shape);
  // Throws an Error where a tensor was never taken.
  void finish() const;

 private:
  const WeightFile& file_;
  std::set<std::string> taken_;
};

}  // namespace fathom::nn
