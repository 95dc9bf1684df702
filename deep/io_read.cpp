// Reads bands: all sample counts first, which are checked against the file and the memory limit, then the samples.
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/chunk_reader.h"

namespace fathom::deep {

namespace {

const PartInfo& choosePart(const ExrFile& file, const std::string& wanted) {
  const std::vector<PartInfo>& parts = file.parts();
  auto it = std::find_if(parts.begin(), parts.end(),
                         [&](const PartInfo& part) { return wanted.empty() ? part.deep : part.name == wanted; });
  const bool number =
      !wanted.empty() && wanted.size() < 9 && wanted.find_first_not_of("0123456789") == std::string::npos;
  if (it == parts.end() && number && size_t(std::stoi(wanted)) < parts.size()) it = parts.begin() + std::stoi(wanted);
  if (it == parts.end() && wanted.empty()) fail("{}: expected a deep part, found flat ones", file.bytes().path());
  if (it == parts.end()) fail("{}: expected a part {}, found {} parts", file.bytes().path(), wanted, parts.size());
  if (!it->deep) fail("{}: expected a deep part, found a flat one", file.where(*it));
  return *it;
}

// A channel that the caller asked for, and where it begins in a row of samples, in bytes per sample.
struct Wanted {
  Channel* channel;
  size_t before;
};

void copyRow(const Unpacked& samples, size_t at, size_t first, size_t n, Channel& to) {
  if (to.type == PixelType::Uint)
    samples.copy(at, std::span<uint32_t>(to.ids.data() + first, n));
  else if (to.type == PixelType::Float)
    samples.copy(at, std::span<float>(to.values.data() + first, n));
  else
    samples.copyHalf(at, std::span<float>(to.values.data() + first, n));
}

}  // namespace

struct Reader::Impl {
  Impl(const std::string& path, ReadOptions opts)
      : file(path), options(std::move(opts)), part(choosePart(file, options.part)), chunks(file, part) {}

  bool wants(const ChannelInfo& channel) const { return !options.channels || options.channels(channel.name); }

  size_t wantedBytes() const {
    return 4 * size_t(std::count_if(part.channels.begin(), part.channels.end(), [&](auto& c) { return wants(c); }));
  }

  Box rowsOf(int y0, int y1) const {
    const Box& w = part.dataWindow;
    if (y0 < w.y0 || y1 > w.y1 || y0 > y1)
      fail("{}: expected rows within {} to {}, found {} to {}", file.where(part), w.y0, w.y1, y0, y1);
    return {w.x0, y0, w.x1, y1};
  }

  void limit(const Box& band, double bytes, const char* what) const {
    if (bytes > double(options.memoryLimit))
      fail("{}, rows {} to {}: {} would take {:.0f} MB, more than the memory limit of {:.0f} MB", file.where(part),
           band.y0, band.y1 - 1, what, bytes / 1e6, double(options.memoryLimit) / 1e6);
  }

  // All chunks of a band that covers whole ones.
  std::vector<Chunk> open(const Box& area) const {
    std::vector<Chunk> result;
    if (area.empty()) return result;
    const ChunkGrid& grid = chunks.grid();
    for (int row = grid.rowOf(area.y0); row <= grid.rowOf(area.y1 - 1); ++row)
      for (int column = 0; column < grid.columns(); ++column) result.push_back(chunks.open(column, row));
    return result;
  }

  Buffer<uint32_t> readCounts(const std::vector<Chunk>& list, const Box& area) {
    Buffer<uint32_t> counts(area.area());
    parallelFor(0, int(list.size()), [&](int i) {
      const Chunk& chunk = list[size_t(i)];
      uint32_t* first = counts.data() + area.index(chunk.box.x0, chunk.box.y0);
      chunks.readCounts(chunk, scratch.local(), first, size_t(area.width()));
    });
    return counts;
  }

  std::vector<Wanted> addChannels(DeepImage& image) const {
    std::vector<size_t> before;
    size_t sum = 0;
    for (const ChannelInfo& c : part.channels) {
      if (wants(c)) {
        image.add(c.name, c.type);
        before.push_back(sum);
      }
      sum += valueBytes(c.type);
    }
    std::vector<Wanted> result;
    for (size_t i = 0; i < before.size(); ++i) result.push_back({&image.channels[i], before[i]});
    return result;
  }

  // `counts` are those of the whole chunks in `area`; the image may have fewer rows.
  void readSamples(const Chunk& chunk, const Box& area, const Buffer<uint32_t>& counts,
                   const std::vector<Wanted>& wanted, DeepImage& image) {
    const Unpacked samples = chunks.readSamples(chunk, scratch.local());
    size_t at = 0;
    for (int y = chunk.box.y0; y < std::min(chunk.box.y1, image.dataWindow.y1); ++y) {
      const uint32_t* row = counts.data() + area.index(chunk.box.x0, y);
      const size_t n = std::accumulate(row, row + chunk.box.width(), size_t(0));
      if (y >= image.dataWindow.y0) {
        const size_t first = size_t(image.offsets[image.dataWindow.index(chunk.box.x0, y)]);
        for (const Wanted& w : wanted) copyRow(samples, at + n * w.before, first, n, *w.channel);
      }
      at += n * chunks.sampleBytes();
    }
  }

  ExrFile file;
  ReadOptions options;
  const PartInfo& part;
  ChunkReader chunks;
  tbb::enumerable_thread_specific<ChunkReader::Scratch> scratch;
};

Reader::Reader(const std::string& path, ReadOptions options)
    : impl_(std::make_unique<Impl>(path, std::move(options))) {}
Reader::Reader(Reader&&) noexcept = default;
Reader::~Reader() = default;

const PartInfo& Reader::part() const {
  return impl_->part;
}

Buffer<uint32_t> Reader::sampleCounts(int y0, int y1) {
  const Box band = impl_->rowsOf(y0, y1), area = impl_->chunks.grid().covering(band);
  impl_->limit(band, 4.0 * double(area.area()), "sample counts");
  Buffer<uint32_t> all = impl_->readCounts(impl_->open(area), area);
  if (band == area) return all;
  Buffer<uint32_t> result(band.area());
  std::copy_n(all.data() + area.index(area.x0, y0), result.size(), result.data());
  return result;
}

int Reader::bandEnd(int y0, size_t bytes) {
  constexpr int kRowsAtOnce = 16;
  const PartInfo& part = impl_->part;
  const size_t width = size_t(part.dataWindow.width());
  double used = 0;
  for (int y = y0; y < part.dataWindow.y1;) {
    const Box ahead = {part.dataWindow.x0, y, part.dataWindow.x1,
                       std::min(part.dataWindow.y1, y + (part.tiled ? 1 : kRowsAtOnce))};
    const int next = impl_->chunks.grid().covering(ahead).y1;
    const Buffer<uint32_t> counts = sampleCounts(y, next);
    for (int row = 0; row < next - y; ++row) {
      const uint32_t* first = counts.data() + size_t(row) * width;
      const double samples = std::accumulate(first, first + width, 0.0);
      used += 12.0 * double(width) + samples * double(impl_->wantedBytes());
      const int end = part.tiled ? y : y + row;
      if (used > double(bytes) && end > y0) return end;
    }
    y = next;
  }
  return part.dataWindow.y1;
}

DeepImage Reader::read(int y0, int y1) {
  const PartInfo& part = impl_->part;
  const Box band = impl_->rowsOf(y0, y1), area = impl_->chunks.grid().covering(band);
  const double countBytes = 12.0 * double(area.area());
  impl_->limit(band, countBytes, "sample counts");
  const std::vector<Chunk> chunks = impl_->open(area);
  const Buffer<uint32_t> counts = impl_->readCounts(chunks, area);

  DeepImage image{band, part.displayWindow, Buffer<uint64_t>(band.area() + 1), {}, part.attributes};
  const uint32_t* inBand = counts.data() + (band.empty() ? 0 : area.index(area.x0, y0));
  image.offsets[0] = 0;
  for (size_t i = 0; i < band.area(); ++i) image.offsets[i + 1] = image.offsets[i] + inBand[i];
  impl_->limit(band, countBytes + double(image.samples()) * double(impl_->wantedBytes()), "samples");
  for (const Chunk& chunk : chunks) impl_->limit(chunk.box, double(chunk.sampleBytes), "samples");

  const std::vector<Wanted> wanted = impl_->addChannels(image);
  if (!wanted.empty())
    parallelFor(0, int(chunks.size()),
                [&](int i) { impl_->readSamples(chunks[size_t(i)], area, counts, wanted, image); });
  return image;
}

DeepImage Reader::read() {
  return read(impl_->part.dataWindow.y0, impl_->part.dataWindow.y1);
}

std::vector<PartInfo> readParts(const std::string& path) {
  return ExrFile(path).parts();
}

DeepImage read(const std::string& path, const ReadOptions& options) {
  return Reader(path, options).read();
}

}  // namespace fathom::deep
