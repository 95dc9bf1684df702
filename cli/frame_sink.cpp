#include "cli/frame_sink.h"

#include <algorithm>
#include <filesystem>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/one_bin.h"
#include "flat/io.h"

namespace fathom::cli {

namespace {

bool isComponent(const std::string& name) {
  return name.starts_with("diffuse.") || name.starts_with("specular.");
}

// The image with one component in the place of the colour.
deep::DeepImage onlyComponent(const deep::DeepImage& image, const std::string& component) {
  deep::DeepImage result = image.copy();
  for (const std::string channel : {"R", "G", "B"}) {
    deep::Channel* part = result.find(fmt::format("{}.{}", component, channel));
    if (!part) fail("channel {}.{}: expected in the image, found none", component, channel);
    part->name = "part " + channel;
    result.erase(channel);
    result.find("part " + channel)->name = channel;
  }
  std::erase_if(result.channels, [](const deep::Channel& channel) { return isComponent(channel.name); });
  return result;
}

// Appends rows to an image of the whole window.
void append(flat::Image& whole, const flat::Image& rows) {
  for (const flat::Plane& plane : rows.planes) {
    flat::Plane* to = whole.find(plane.name);
    if (!to) to = &whole.add(plane.name);
    std::copy(plane.values.begin(), plane.values.end(),
              to->values.begin() + std::ptrdiff_t(whole.dataWindow.index(rows.dataWindow.x0, rows.dataWindow.y0)));
  }
}

// What an output says of how it was made. An input may say so of itself, which is not passed on.
std::map<std::string, std::string> ownAttributes(const FrameOrigin& origin) {
  std::map<std::string, std::string> result = {{kMadeBy, origin.madeBy}};
  if (origin.record) {
    result[kBudget] = origin.record->budget;
    result[kSetting] = origin.record->setting;
  }
  return result;
}

}  // namespace

// One file: deep rows go through a Writer, flat ones are gathered.
class FrameSink::Output {
 public:
  Output(std::string path, std::string component, bool flatten)
      : path_(std::move(path)), component_(std::move(component)), flatten_(flatten) {}

  void write(const deep::DeepImage& rows, const FrameOrigin& origin) {
    if (!component_.empty()) return put(onlyComponent(rows, component_), origin);
    put(rows, origin);
  }

  void finish(const FrameOrigin& origin) {
    if (writer_) return writer_->finish();
    for (const auto& [name, text] : ownAttributes(origin)) flat_->attributes[name] = text;
    flat::write(path_, *flat_);
  }

 private:
  void put(const deep::DeepImage& rows, const FrameOrigin& origin) {
    if (!origin.deep) {
      deep::DeepImage pixels = rows.copy();
      deep::unmakeOneBin(pixels);
      return gather(deep::toFlat(pixels), origin, origin.flatAttributes);
    }
    if (flatten_) {
      flat::Image flattened = deep::flatten(rows);
      return gather(flattened, origin, flattened.attributes);
    }
    if (!writer_) {
      deep::DeepImage layout = rows.copyLayout();
      for (const deep::Channel& channel : rows.channels)
        layout.channels.push_back({channel.name, channel.type, {}, {}});
      layout.attributes.erase(kBudget);
      layout.attributes.erase(kSetting);
      for (const auto& [name, text] : ownAttributes(origin)) layout.attributes.set(name, text);
      deep::WriteOptions options;
      options.otherPartsOf = origin.path;
      options.replacedPart = origin.part;
      writer_.emplace(path_, layout, origin.dataWindow, options);
    }
    writer_->write(rows);
  }

  void gather(const flat::Image& rows, const FrameOrigin& origin,
              const std::map<std::string, std::string>& attributes) {
    if (!flat_) {
      flat_ = flat::Image{origin.dataWindow, rows.displayWindow, {}, attributes};
      for (const char* name : {kBudget, kSetting}) flat_->attributes.erase(name);
    }
    append(*flat_, rows);
  }

  std::string path_, component_;
  bool flatten_;
  std::optional<deep::Writer> writer_;
  std::optional<flat::Image> flat_;
};

std::vector<std::string> FrameOutputs::files() const {
  std::vector<std::string> result;
  for (const auto& [name, path] : components) result.push_back(path);
  if (!flattened.empty()) result.push_back(flattened);
  result.push_back(image);
  return result;
}

Standing standingOf(const std::string& path, const char* attribute, const std::string& madeBy) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) return Standing::Missing;
  try {
    for (const deep::PartInfo& part : deep::readParts(path))
      if (part.attributes.getString(attribute) == madeBy) return Standing::Ours;
  } catch (const Error&) {
    // Not even an EXR file: certainly not made by this run.
  }
  return Standing::Other;
}

// The image itself comes last: where it stands, the frame is complete.
FrameSink::FrameSink(const FrameOutputs& outputs, FrameOrigin origin) : origin_(std::move(origin)) {
  for (const auto& [name, path] : outputs.components) outputs_.push_back(std::make_unique<Output>(path, name, false));
  if (!outputs.flattened.empty()) outputs_.push_back(std::make_unique<Output>(outputs.flattened, "", true));
  outputs_.push_back(std::make_unique<Output>(outputs.image, "", origin_.flattened));
}

FrameSink::FrameSink(FrameSink&&) noexcept = default;
FrameSink::~FrameSink() = default;

void FrameSink::write(deep::DeepImage rows) {
  for (const auto& output : outputs_) output->write(rows, origin_);
}

void FrameSink::finish() {
  for (const auto& output : outputs_) output->finish(origin_);
}

}  // namespace fathom::cli
