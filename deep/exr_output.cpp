#include "deep/exr_output.h"

#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfVersion.h>

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "base/error.h"

namespace fathom::deep {

namespace {

// The bytes of a chunk in a file of many parts, from its part number on.
uint64_t chunkBytes(const ExrFile& file, const PartInfo& part, uint64_t at) {
  const uint64_t head = 4 + (part.tiled ? 16 : 4);
  if (!part.deep) {
    uint32_t size;
    file.bytes().read(at + head, &size, sizeof(size));
    return head + sizeof(size) + size;
  }
  uint64_t sizes[3];
  file.bytes().read(at + head, sizes, sizeof(sizes));
  const uint64_t rest = file.bytes().size() - at - head - sizeof(sizes);
  if (sizes[0] > rest || sizes[1] > rest - sizes[0])
    fail("{}: expected {} and {} bytes in a chunk, found a file that ends after {}", file.where(part), sizes[0],
         sizes[1], rest);
  return head + sizeof(sizes) + sizes[0] + sizes[1];
}

}  // namespace

ExrOutput::ExrOutput(const std::string& path, const Imf::Header& header, size_t chunks, const std::string& otherPartsOf,
                     int replacedPart)
    : file_(path) {
  std::optional<ExrFile> other;
  if (!otherPartsOf.empty()) other.emplace(otherPartsOf);
  const size_t count = other ? other->parts().size() : 1;
  own_ = other ? size_t(replacedPart) : 0;
  if (own_ >= count) fail("{}: expected part {}, found {} parts", otherPartsOf, replacedPart, count);
  for (size_t i = 0; i < count; ++i) {
    if (i == own_)
      parts_.push_back({header, std::vector<uint64_t>(chunks)});
    else
      parts_.push_back({other->parts()[i].attributes.header(), other->chunkTable(other->parts()[i])});
    parts_[i].header.setChunkCount(int(parts_[i].table.size()));
  }
  if (count > 1) parts_[own_].header.setName(other->parts()[own_].name);
  setMostSamples(0);
  file_.append(Bytes(head().size()));
  for (size_t i = 0; i < count; ++i)
    if (i != own_) copyPart(*other, other->parts()[i], parts_[i].table);
}

void ExrOutput::copyPart(const ExrFile& other, const PartInfo& part, std::vector<uint64_t>& table) {
  if (!Imf::isSupportedType(part.attributes.header().type()))
    fail("{}: cannot copy a part of type {}", other.where(part), printable(part.attributes.header().type()));
  uint64_t copied = 0;
  Bytes chunk;
  for (uint64_t& at : table) {
    if (at == 0 || at > other.bytes().size()) fail("{}: cannot copy: the part was not finished", other.where(part));
    chunk.resize(size_t(std::min(chunkBytes(other, part, at), other.bytes().size())));
    copied += chunk.size();
    if (copied > other.bytes().size()) fail("{}: expected chunks apart, found some that overlap", other.where(part));
    other.bytes().read(at, chunk.data(), chunk.size());
    at = file_.append(chunk);
  }
}

void ExrOutput::setMostSamples(uint32_t most) {
  eraseAttribute(parts_[own_].header, "maxSamplesPerPixel");
  parts_[own_].header.insert("maxSamplesPerPixel", Imf::IntAttribute(int(most)));
}

// Everything in front of the chunks.
Bytes ExrOutput::head() const {
  Bytes bytes;
  put(bytes, Imf::MAGIC);
  int version = Imf::EXR_VERSION | Imf::NON_IMAGE_FLAG | (parts_.size() > 1 ? Imf::MULTI_PART_FILE_FLAG : 0);
  for (const Part& part : parts_) version |= hasLongNames(part.header) ? Imf::LONG_NAMES_FLAG : 0;
  put(bytes, version);
  for (const Part& part : parts_) putHeader(bytes, part.header, Imf::isTiled(part.header.type()));
  if (parts_.size() > 1) bytes.push_back(0);
  for (const Part& part : parts_)
    for (uint64_t at : part.table) put(bytes, at);
  return bytes;
}

void ExrOutput::finish(uint32_t mostSamples) {
  setMostSamples(mostSamples);
  file_.overwrite(0, head());
  file_.finish();
}

}  // namespace fathom::deep
