// One frame's outputs: the denoised image, and what is made from it, written row by row and in place only when
// complete.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/denoise_setting.h"
#include "deep/image.h"
#include "deep/io.h"
#include "flat/image.h"

namespace fathom::cli {

// The name of the attribute by which a run knows its own outputs.
constexpr const char* kMadeBy = "fathom:denoise";

struct FrameOutputs {
  std::string image;
  std::string flattened;                          // empty: none
  std::map<std::string, std::string> components;  // by name: "diffuse", "specular"

  std::vector<std::string> files() const;
};

enum class Standing { Missing, Ours, Other };

// Whether a file is there and was made by the run that `madeBy` describes in an attribute.
Standing standingOf(const std::string& path, const char* attribute, const std::string& madeBy);

// Where the image that comes in comes from, and what goes with it.
struct FrameOrigin {
  std::string path;
  bool deep = true;
  int part = 0;
  Box dataWindow;
  std::map<std::string, std::string> flatAttributes;
  std::string madeBy;
  std::optional<BudgetRecord> record;
  bool flattened = false;  // the image itself is written as a flat one
};

class FrameSink {
 public:
  FrameSink(const FrameOutputs& outputs, FrameOrigin origin);
  FrameSink(FrameSink&&) noexcept;
  ~FrameSink();

  // The next rows below those already written.
  void write(deep::DeepImage rows);
  void finish();

 private:
  class Output;

  FrameOrigin origin_;
  std::vector<std::unique_ptr<Output>> outputs_;
};

}  // namespace fathom::cli
