#include "nn/weights.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace fathom::nn {

namespace {

using nlohmann::json;

constexpr uint64_t kLengthBytes = 8;
constexpr uint64_t kMostHeader = uint64_t(1) << 20;
constexpr uint64_t kMostFile = (uint64_t(1) << 30) + kMostHeader + kLengthBytes;
constexpr size_t kMostTensors = 4096;
constexpr size_t kMostDimensions = 8;
constexpr size_t kMostNameLength = 256;

uint64_t littleEndian(std::span<const std::byte> bytes) {
  uint64_t value = 0;
  for (size_t i = bytes.size(); i-- > 0;) value = value << 8 | std::to_integer<uint64_t>(bytes[i]);
  return value;
}

float fromBfloat16(uint16_t bits) {
  return std::bit_cast<float>(uint32_t(bits) << 16);
}

float fromFloat16(uint16_t bits) {
  const int exponent = bits >> 10 & 31, mantissa = bits & 1023;
  const float sign = bits & 0x8000 ? -1.0f : 1.0f;
  if (exponent == 31) return mantissa ? std::nanf("") : sign * HUGE_VALF;
  if (exponent == 0) return sign * std::ldexp(float(mantissa), -24);
  return sign * std::ldexp(float(1024 + mantissa), exponent - 25);
}

enum class Storage { F32, F16, BF16 };

size_t bytesOf(Storage storage) {
  return storage == Storage::F32 ? 4 : 2;
}

float valueAt(std::span<const std::byte> bytes, Storage storage, size_t i) {
  const uint64_t bits = littleEndian(bytes.subspan(i * bytesOf(storage), bytesOf(storage)));
  if (storage == Storage::F32) return std::bit_cast<float>(uint32_t(bits));
  return storage == Storage::F16 ? fromFloat16(uint16_t(bits)) : fromBfloat16(uint16_t(bits));
}

// The header as JSON; no name comes twice, which the parser alone would let pass, and nothing is nested deeper than
// the format needs.
json parseHeader(std::string_view text, const std::string& file) {
  std::vector<std::set<std::string>> names;
  const auto check = [&](int depth, json::parse_event_t event, json& value) {
    if (depth > 3) fail("{}: the header is nested deeper than a table of tensors", file);
    if (event == json::parse_event_t::object_start) names.emplace_back();
    if (event == json::parse_event_t::object_end) names.pop_back();
    if (event == json::parse_event_t::key && !names.back().insert(value.get<std::string>()).second)
      fail("{}: the header has the name {} twice", file, printable(value.get<std::string>()));
    return true;
  };
  try {
    json header = json::parse(text, check);
    if (!header.is_object()) fail("{}: expected a JSON object as the header, found {}", file, header.type_name());
    return header;
  } catch (const json::exception& e) {
    fail("{}: the header is no JSON: {}", file, printable(oneLine(e.what())));
  }
}

// One tensor as the header tells of it.
struct Entry {
  std::string name;
  Storage storage = Storage::F32;
  std::vector<int64_t> shape;
  uint64_t begin = 0, end = 0;  // bytes after the header
};

class EntryReader {
 public:
  EntryReader(std::string file, std::string name) : where_(std::move(file) + ", tensor " + printable(name)) {
    entry_.name = std::move(name);
  }

  Entry read(const json& value) {
    if (!value.is_object()) fail("{}: expected an object, found {}", where_, value.type_name());
    for (const auto& item : value.items())
      if (item.key() != "dtype" && item.key() != "shape" && item.key() != "data_offsets")
        fail("{}: expected dtype, shape and data_offsets, found {}", where_, printable(item.key()));
    readStorage(member(value, "dtype"));
    readShape(member(value, "shape"));
    readRange(member(value, "data_offsets"));
    return std::move(entry_);
  }

 private:
  const json& member(const json& value, const char* key) const {
    const auto found = value.find(key);
    if (found == value.end()) fail("{}: {} is missing", where_, key);
    return *found;
  }

  uint64_t number(const json& value, const char* what) const {
    if (!value.is_number_unsigned())
      fail("{}: expected whole numbers of at least 0 as {}, found {}", where_, what, shortText(value));
    return value.get<uint64_t>();
  }

  static std::string shortText(const json& value) {
    std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
    if (text.size() > 60) text = text.substr(0, 57) + "...";
    return text;
  }

  void readStorage(const json& value) {
    const std::string found = value.is_string() ? value.get<std::string>() : shortText(value);
    if (found == "F32")
      entry_.storage = Storage::F32;
    else if (found == "F16")
      entry_.storage = Storage::F16;
    else if (found == "BF16")
      entry_.storage = Storage::BF16;
    else
      fail("{}: expected dtype F32, F16 or BF16, found {}", where_, printable(found.substr(0, 60)));
  }

  void readShape(const json& value) {
    if (!value.is_array() || value.size() > kMostDimensions)
      fail("{}: expected a shape of at most {} numbers, found {}", where_, kMostDimensions, shortText(value));
    bytes_ = bytesOf(entry_.storage);
    for (const json& item : value) {
      const uint64_t size = number(item, "the shape");
      if (size == 0) fail("{}: the shape {} has nothing in it", where_, shortText(value));
      if (size > kMostFile / bytes_) fail("{}: the shape {} is larger than any file", where_, shortText(value));
      bytes_ *= size;
      entry_.shape.push_back(int64_t(size));
    }
  }

  void readRange(const json& value) {
    if (!value.is_array() || value.size() != 2)
      fail("{}: expected two numbers as data_offsets, found {}", where_, shortText(value));
    entry_.begin = number(value[0], "data_offsets");
    entry_.end = number(value[1], "data_offsets");
    if (entry_.end < entry_.begin || entry_.end - entry_.begin != bytes_)
      fail("{}: expected {} bytes for shape {}, found data_offsets {}", where_, bytes_, shapeText(entry_.shape),
           shortText(value));
  }

  std::string where_;
  Entry entry_;
  uint64_t bytes_ = 0;
};

void readMetadata(const json& value, WeightFile& file) {
  if (!value.is_object()) fail("{}: expected strings as __metadata__, found {}", file.name, value.type_name());
  for (const auto& item : value.items()) {
    if (!item.value().is_string())
      fail("{}: expected a string as metadata {}, found {}", file.name, printable(item.key()),
           item.value().type_name());
    file.metadata[item.key()] = item.value().get<std::string>();
  }
}

std::vector<Entry> readEntries(const json& header, WeightFile& file) {
  const size_t tensors = header.size() - header.count("__metadata__");
  if (tensors > kMostTensors) fail("{}: expected at most {} tensors, found {}", file.name, kMostTensors, tensors);
  std::vector<Entry> entries;
  for (const auto& item : header.items()) {
    if (item.key() == "__metadata__") {
      readMetadata(item.value(), file);
      continue;
    }
    if (item.key().empty() || item.key().size() > kMostNameLength)
      fail("{}: expected tensor names of 1 to {} bytes, found one of {}", file.name, kMostNameLength,
           item.key().size());
    entries.push_back(EntryReader(file.name, item.key()).read(item.value()));
  }
  std::ranges::sort(entries, {}, [](const Entry& e) { return std::pair(e.begin, e.end); });
  return entries;
}

// The ranges, in order, must follow one another from the first byte to the last.
void checkRanges(const std::vector<Entry>& entries, uint64_t dataBytes, const std::string& file) {
  uint64_t next = 0;
  for (const Entry& entry : entries) {
    if (entry.end > dataBytes)
      fail("{}, tensor {}: expected data within {} bytes, found it to end at {}", file, printable(entry.name),
           dataBytes, entry.end);
    if (entry.begin != next)
      fail("{}, tensor {}: expected data from byte {} on, found {} ({})", file, printable(entry.name), next,
           entry.begin, entry.begin < next ? "two tensors overlap" : "bytes that belong to no tensor");
    next = entry.end;
  }
  if (next != dataBytes) fail("{}: expected {} bytes of tensors, found {}", file, next, dataBytes);
}

Tensor readTensor(const Entry& entry, std::span<const std::byte> data, const std::string& file) {
  const std::span<const std::byte> bytes = data.subspan(entry.begin, entry.end - entry.begin);
  Tensor tensor{entry.shape, Buffer<float>(bytes.size() / bytesOf(entry.storage))};
  for (size_t i = 0; i < tensor.values.size(); ++i) {
    tensor.values[i] = valueAt(bytes, entry.storage, i);
    if (!std::isfinite(tensor.values[i]))
      fail("{}, tensor {}: expected finite numbers, found {} at index {}", file, printable(entry.name),
           tensor.values[i], i);
  }
  return tensor;
}

}  // namespace

std::string shapeText(std::span<const int64_t> shape) {
  if (shape.empty()) return "scalar";
  return fmt::format("{}", fmt::join(shape, "x"));
}

WeightFile readWeights(std::span<const std::byte> bytes, const std::string& name) {
  WeightFile file;
  file.name = name;
  if (bytes.size() < kLengthBytes)
    fail("{}: expected a safetensors file of at least {} bytes, found {}", name, kLengthBytes, bytes.size());
  const uint64_t headerBytes = littleEndian(bytes.first(kLengthBytes));
  if (headerBytes > kMostHeader)
    fail("{}: expected a safetensors header of at most {} bytes, found {}", name, kMostHeader, headerBytes);
  if (headerBytes > bytes.size() - kLengthBytes)
    fail("{}: expected a header of {} bytes, found a file of {}", name, headerBytes, bytes.size());
  const std::span<const std::byte> data = bytes.subspan(kLengthBytes + headerBytes);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()) + kLengthBytes, headerBytes);
  const std::vector<Entry> entries = readEntries(parseHeader(text, name), file);
  checkRanges(entries, data.size(), name);
  for (const Entry& entry : entries) file.tensors.emplace(entry.name, readTensor(entry, data, name));
  return file;
}

WeightFile readWeights(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored))
    fail("{}: expected a weight file, found something else", path);
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  if (!stream) fail("{}: cannot be read: {}", path, std::strerror(errno));
  const std::streamoff size = stream.tellg();
  if (size < 0 || uint64_t(size) > kMostFile)
    fail("{}: expected a weight file of at most {} bytes, found {}", path, kMostFile, size);
  Buffer<std::byte> bytes{size_t(size)};
  stream.seekg(0);
  if (!stream.read(reinterpret_cast<char*>(bytes.data()), size)) fail("{}: cannot be read to its end", path);
  return readWeights(std::span<const std::byte>(bytes), path);
}

const Tensor& WeightSource::take(const std::string& name, const std::vector<int64_t>& shape) {
  const auto found = file_.tensors.find(name);
  if (found == file_.tensors.end()) fail("{}: tensor {} is missing", file_.name, name);
  if (found->second.shape != shape)
    fail("{}, tensor {}: expected shape {}, found {}", file_.name, name, shapeText(shape),
         shapeText(found->second.shape));
  taken_.insert(name);
  return found->second;
}

void WeightSource::finish() const {
  for (const auto& [name, tensor] : file_.tensors)
    if (!taken_.contains(name)) fail("{}, tensor {}: no layer takes it", file_.name, printable(name));
}

}  // namespace fathom::nn
