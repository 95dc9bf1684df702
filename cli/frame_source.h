// One frame's input for the denoiser: the main file, deep or flat, with what other files add to it, brought to Fathom's
// convention row by row.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cli/channel_map.h"
#include "deep/image.h"
#include "deep/io.h"

namespace fathom::cli {

// The files of one frame; an empty name stands for none.
struct FrameInputs {
  std::string main;
  std::string features;
  std::array<std::string, 2> halves;
  std::string alpha;
  std::string guide;  // a flat image that is denoised already; not read by FrameSource

  std::vector<std::string> files() const;  // the main one first
};

// An error's text as it is where it begins with one of the files, else with the first of them put before it.
std::string namingFile(const std::string& text, const std::vector<std::string>& files);

struct SourceOptions {
  std::string part;  // of the main file: number or name; empty: the first deep part, or else the first
  std::optional<ChannelMap> map;
  size_t memory = size_t(8) << 30;  // bytes that one decoded image may take
};

// A file of the frame under our channel names.
class MappedFile;

class FrameSource {
 public:
  FrameSource(const FrameInputs& inputs, const SourceOptions& options);
  FrameSource(FrameSource&&) noexcept;
  ~FrameSource();

  const std::string& path() const;  // of the main file
  bool deep() const;
  const deep::PartInfo& part() const;
  // Whether the main file has half buffers, variances or counts: its samples are bins.
  bool hasStatistics() const;
  // What a flat file's output carries along; empty for a deep file.
  std::map<std::string, std::string> flatAttributes() const;

  // From now on, only channels of the main file with these names are read.
  void want(std::function<bool(const std::string&)> wanted);
  // Whether the main file says how large things are in pixels, which clustering goes by.
  bool tellsDepthScale() const;
  // The main file holds one sample per camera sample: they become bins, as `fathom cluster` makes them. Throws Error
  // where it does not tell the scale.
  void clusterFirst();

  // Bytes that rows [y0, y1) take when they are decoded, all files together.
  size_t decodedBytes(int y0, int y1);
  // Rows [y0, y1): sorted bins under our names. `notes` receives what the user ought to know, a line each.
  deep::DeepImage read(int y0, int y1, std::set<std::string>& notes);
  deep::DeepImage read(std::set<std::string>& notes);

 private:
  std::unique_ptr<MappedFile> main_, features_, alpha_;
  std::optional<float> ppuScale_;  // of a main file that is clustered first
  std::array<std::unique_ptr<MappedFile>, 2> halves_;
};

}  // namespace fathom::cli
