// Weight files for tests, written in memory: right ones, and ones that are wrong in the way that a test wants.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace fathom::reference {

struct PlainTensor {
  std::vector<int64_t> shape;
  std::vector<float> values;
};

struct PlainWeights {
  std::map<std::string, PlainTensor> tensors;
  std::map<std::string, std::string> metadata;
};

using Bytes = std::vector<std::byte>;

inline Bytes withHeader(const std::string& header, const Bytes& data) {
  Bytes bytes;
  for (int i = 0; i < 8; ++i) bytes.push_back(std::byte(uint64_t(header.size()) >> (8 * i) & 255));
  for (const char c : header) bytes.push_back(std::byte(c));
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

inline Bytes bytesOf(const std::vector<float>& values) {
  Bytes bytes(values.size() * sizeof(float));
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

inline Bytes safetensors(const PlainWeights& weights) {
  nlohmann::json header;
  if (!weights.metadata.empty()) header["__metadata__"] = weights.metadata;
  Bytes data;
  for (const auto& [name, tensor] : weights.tensors) {
    const Bytes bytes = bytesOf(tensor.values);
    header[name] = {
        {"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {data.size(), data.size() + bytes.size()}}};
    data.insert(data.end(), bytes.begin(), bytes.end());
  }
  return withHeader(header.dump(), data);
}

}  // namespace fathom::reference
