#include "cli/frame_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "deep/assemble.h"
#include "deep/channels.h"
#include "deep/cluster.h"
#include "deep/one_bin.h"
#include "deep/ppu_scale.h"
#include "deep/tidy.h"
#include "flat/io.h"

namespace fathom::cli {

namespace {

// Camera samples of a half buffer's pixel where no file says how many there were. Only ratios of counts matter.
constexpr double kAssumedHalfSamples = 16;

const deep::PartInfo& choosePart(const std::string& path, const std::vector<deep::PartInfo>& parts,
                                 const std::string& wanted) {
  for (const deep::PartInfo& part : parts)
    if (wanted.empty() ? part.deep : part.name == wanted || fmt::format("{}", part.number) == wanted) return part;
  if (wanted.empty() && !parts.empty()) return parts.front();
  fail("{}: expected a part {}, found {} parts", path, wanted, parts.size());
}

std::vector<std::string> namesOf(const deep::PartInfo& part) {
  std::vector<std::string> names;
  for (const deep::ChannelInfo& channel : part.channels) names.push_back(channel.name);
  return names;
}

bool anyStatistics(const std::vector<std::string>& channels) {
  return std::any_of(channels.begin(), channels.end(), [](const std::string& name) {
    return deep::describesSamples(deep::roleOf(name, deep::PixelType::Float));
  });
}

}  // namespace

class MappedFile {
 public:
  MappedFile(const std::string& path, const std::string& partName, const SourceOptions& options)
      : path_(path), memory_(options.memory), part_(choosePart(path, deep::readParts(path), partName)) {
    const std::vector<std::string> theirs = namesOf(part_);
    if (options.map) map_ = resolveMap(*options.map, theirs);
    hasStatistics_ = anyStatistics(mappedNames(map_, theirs));
  }

  const std::string& path() const { return path_; }
  const deep::PartInfo& part() const { return part_; }
  bool hasStatistics() const { return hasStatistics_; }

  void want(std::function<bool(const std::string&)> wanted) {
    wanted_ = std::move(wanted);
    reader_.reset();
  }

  deep::DeepImage read(int y0, int y1, std::set<std::string>& notes) {
    y0 = std::clamp(y0, part_.dataWindow.y0, part_.dataWindow.y1);
    y1 = std::clamp(y1, y0, part_.dataWindow.y1);
    if (!part_.deep) {
      deep::DeepImage image = deep::rows(pixels(), y0, y1);
      deep::makeOneBin(image);
      return image;
    }
    deep::DeepImage image = reader().read(y0, y1);
    applyMap(map_, image);
    return inDepthOrder(std::move(image), notes);
  }

  flat::Image readFlat(int y0, int y1) {
    y0 = std::clamp(y0, part_.dataWindow.y0, part_.dataWindow.y1);
    y1 = std::clamp(y1, y0, part_.dataWindow.y1);
    return deep::toFlat(deep::rows(pixels(), y0, y1));
  }

  const std::map<std::string, std::string>& flatAttributes() {
    pixels();
    return attributes_;
  }

  size_t decodedBytes(int y0, int y1) {
    constexpr size_t kValue = 4, kOffset = 8;
    const size_t pixels = size_t(part_.dataWindow.width()) * size_t(std::max(0, y1 - y0));
    if (!part_.deep) return pixels * (part_.channels.size() * kValue + kOffset);
    y0 = std::clamp(y0, part_.dataWindow.y0, part_.dataWindow.y1);
    y1 = std::clamp(y1, y0, part_.dataWindow.y1);
    size_t channels = 0, samples = 0;
    for (const deep::ChannelInfo& channel : part_.channels) channels += needs(channel.name);
    for (const uint32_t count : reader().sampleCounts(y0, y1)) samples += count;
    return pixels * kOffset + samples * channels * kValue;
  }

 private:
  // Whether a channel of the file is read: for itself, or for one that the map makes of it.
  bool needs(const std::string& theirs) const {
    if (!wanted_) return true;
    bool renamed = false;
    for (const MappedChannel& channel : map_)
      for (const ChannelMap::Term& term : channel.terms)
        if (term.theirs == theirs) {
          if (wanted_(channel.ours)) return true;
          renamed = renamed || channel.terms.size() == 1;
        }
    return !renamed && wanted_(theirs);
  }

  // Front to back. Volumes that overlap have no effective alpha: they are split and merged, but not where the file has
  // statistics of its bins, which no one could split. What is done to a pixel depends on nothing but that pixel.
  deep::DeepImage inDepthOrder(deep::DeepImage image, std::set<std::string>& notes) const {
    const deep::Untidiness found = deep::findUntidiness(image);
    if (found.volumesOverlap && !hasStatistics_) {
      notes.insert(fmt::format("{}: overlapping volumes are split and merged first", path_));
      return deep::tidy(std::move(image)).image;
    }
    if (found.volumesOverlap)
      notes.insert(fmt::format("{}: volumes overlap: their alphas are taken one by one", path_));
    if (!found.unsorted) return image;
    notes.insert(fmt::format("{}: samples are sorted front to back first", path_));
    return deep::sortSamples(std::move(image));
  }

  // A flat file's pixels as samples, not yet made bins.
  const deep::DeepImage& pixels() {
    if (!pixels_) {
      flat::Image image = flat::read(path_, {fmt::format("{}", part_.number), memory_});
      pixels_ = deep::fromFlat(image);
      attributes_ = std::move(image.attributes);
      applyMap(map_, *pixels_);
    }
    return *pixels_;
  }

  deep::Reader& reader() {
    if (!reader_)
      reader_.emplace(path_, deep::ReadOptions{fmt::format("{}", part_.number),
                                               [this](const std::string& name) { return needs(name); }, memory_});
    return *reader_;
  }

  std::string path_;
  size_t memory_;
  deep::PartInfo part_;
  std::vector<MappedChannel> map_;
  bool hasStatistics_ = false;
  std::function<bool(const std::string&)> wanted_;
  std::optional<deep::Reader> reader_;
  std::optional<deep::DeepImage> pixels_;
  std::map<std::string, std::string> attributes_;
};

std::string namingFile(const std::string& text, const std::vector<std::string>& files) {
  const bool named =
      std::any_of(files.begin(), files.end(), [&](const std::string& file) { return text.starts_with(file); });
  return named || files.empty() ? text : fmt::format("{}: {}", files.front(), text);
}

FrameSource::FrameSource(const FrameInputs& inputs, const SourceOptions& options) {
  const auto open = [&](const std::string& path, const std::string& part) {
    return path.empty() ? nullptr : std::make_unique<MappedFile>(path, part, options);
  };
  main_ = open(inputs.main, options.part);
  features_ = open(inputs.features, "");
  alpha_ = open(inputs.alpha, "");
  for (size_t i = 0; i < halves_.size(); ++i) halves_[i] = open(inputs.halves[i], "");
  for (const MappedFile* file : {halves_[0].get(), halves_[1].get(), alpha_.get()})
    if (file && file->part().deep != deep())
      fail("{}: expected a {} file as {} is, found a {} one", file->path(), deep() ? "deep" : "flat", main_->path(),
           deep() ? "flat" : "deep");
  if (alpha_ && !deep()) fail("{}: expected a deep file to give better alphas to, found a flat one", main_->path());
  if (features_ && features_->part().deep && !deep())
    fail("{}: expected flat features for the flat file {}, found deep ones", features_->path(), main_->path());

  const auto place = [](const std::string& name) { return name == "A" || name == "Z" || name == "ZBack"; };
  if (features_) features_->want([=](const std::string& name) { return place(name) || deep::isFeature(name); });
  if (alpha_) alpha_->want(place);
}

FrameSource::FrameSource(FrameSource&&) noexcept = default;
FrameSource::~FrameSource() = default;

const std::string& FrameSource::path() const {
  return main_->path();
}

bool FrameSource::deep() const {
  return main_->part().deep;
}

const deep::PartInfo& FrameSource::part() const {
  return main_->part();
}

std::map<std::string, std::string> FrameSource::flatAttributes() const {
  return deep() ? std::map<std::string, std::string>{} : main_->flatAttributes();
}

bool FrameSource::hasStatistics() const {
  return main_->hasStatistics();
}

void FrameSource::want(std::function<bool(const std::string&)> wanted) {
  main_->want(std::move(wanted));
}

bool FrameSource::tellsDepthScale() const {
  try {
    deep::findPpuScale(part().attributes, part().displayWindow);
    return true;
  } catch (const Error&) {
    return false;
  }
}

void FrameSource::clusterFirst() {
  try {
    ppuScale_ = deep::findPpuScale(part().attributes, part().displayWindow);
  } catch (const Error& e) {
    fail("{}: camera samples, which `fathom cluster` makes bins of: {}", path(), e.what());
  }
}

size_t FrameSource::decodedBytes(int y0, int y1) {
  size_t bytes = 0;
  for (MappedFile* file : {main_.get(), features_.get(), halves_[0].get(), halves_[1].get(), alpha_.get()})
    if (file) bytes += file->decodedBytes(y0, y1);
  return bytes;
}

deep::DeepImage FrameSource::read(int y0, int y1, std::set<std::string>& notes) {
  deep::DeepImage image = main_->read(y0, y1, notes);
  if (ppuScale_) image = deep::cluster(image, deep::findBins(image, *ppuScale_));
  for (int i = 0; i < 2; ++i) {
    if (!halves_[size_t(i)]) continue;
    const deep::DeepImage half = halves_[size_t(i)]->read(y0, y1, notes);
    const std::optional<int> own = half.attributes.getInt("fathom:spp"), whole = image.attributes.getInt("fathom:spp");
    if (!own && !whole && !half.find("samples"))
      notes.insert(fmt::format("{}: no sample counts: halves are taken to have {} camera samples in a pixel",
                               halves_[size_t(i)]->path(), kAssumedHalfSamples));
    deep::addHalf(image, half, i, own ? *own : whole ? *whole / 2.0 : kAssumedHalfSamples);
  }
  if (features_ && features_->part().deep == deep())
    deep::addFeatures(image, features_->read(y0, y1, notes));
  else if (features_)
    deep::addFeatures(image, features_->readFlat(y0, y1));
  if (alpha_) deep::replaceAlpha(image, alpha_->read(y0, y1, notes));
  return image;
}

deep::DeepImage FrameSource::read(std::set<std::string>& notes) {
  return read(part().dataWindow.y0, part().dataWindow.y1, notes);
}

std::vector<std::string> FrameInputs::files() const {
  std::vector<std::string> result;
  for (const std::string& file : {main, features, halves[0], halves[1], alpha, guide})
    if (!file.empty()) result.push_back(file);
  return result;
}

}  // namespace fathom::cli
