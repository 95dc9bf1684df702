#include "cli/denoise_bands.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "cli/memory_limit.h"

namespace fathom::cli {

namespace {

// Bytes that rows take while they are worked on: the images of them, and what their guide is made from.
class Rows {
 public:
  Rows(FrameSource& source, size_t images, size_t guidePixelBytes)
      : source_(source), images_(images), guideRowBytes_(guidePixelBytes * size_t(source.part().dataWindow.width())) {}

  size_t bytes(int y0, int y1) const {
    return source_.decodedBytes(y0, y1) * images_ + guideRowBytes_ * size_t(y1 - y0);
  }

 private:
  FrameSource& source_;
  const size_t images_;
  const size_t guideRowBytes_;
};

std::vector<Band> cutBands(const FrameSource& source, const Rows& rows, int halo, size_t fixed, size_t memory) {
  const Box& window = source.part().dataWindow;
  std::vector<size_t> upTo = {0};
  for (int y = window.y0; y < window.y1; ++y) upTo.push_back(upTo.back() + rows.bytes(y, y + 1));
  const auto bytes = [&](const Band& band) {
    return upTo[size_t(std::min(band.y1 + halo, window.y1) - window.y0)] -
           upTo[size_t(std::max(band.y0 - halo, window.y0) - window.y0)];
  };
  size_t most = 0;
  for (int height = (window.height() + 1) / 2;; height = (height + 1) / 2) {
    std::vector<Band> bands;
    most = 0;
    for (int y = window.y0; y < window.y1; y += height) {
      bands.push_back({y, std::min(y + height, window.y1)});
      most = std::max(most, bytes(bands.back()));
    }
    if (fixed + most <= workingBytes(memory)) return bands;
    if (height == 1) break;
  }
  const std::string guide = fixed ? "the guide of the whole frame and " : "";
  fail(
      "{}: expected at least {} MB of memory, for {}a row with the {} around it that decide it; found a limit of {} MB",
      source.path(), memoryFor(fixed + most) / 1'000'000 + 1, guide, 2 * halo, memory / 1'000'000);
}

GuideBytes bytesOfGuide(const SequencePlan& plan, size_t pixels, size_t memory) {
  return plan.guide ? guideBytes(*plan.guide, pixels, memory) : GuideBytes{};
}

size_t wholeFrameBytes(FrameSource& source, const SequencePlan& plan, size_t memory) {
  const Box& window = source.part().dataWindow;
  const GuideBytes guide = bytesOfGuide(plan, window.area(), memory);
  const size_t library =
      plan.base && plan.base->bytes ? plan.base->bytes(window.area(), decodedLimit(memory)) : guide.library;
  const bool errors = plan.errors || (plan.base && plan.base->tellsErrors);
  return Rows(source, imagesInMemory(errors), guide.madePerPixel).bytes(window.y0, window.y1) + library;
}

}  // namespace

std::vector<Band> planBands(FrameSource& source, const SequencePlan& plan, int halo, size_t memory) {
  const Box& window = source.part().dataWindow;
  const GuideBytes guide = bytesOfGuide(plan, window.area(), memory);
  const size_t images = imagesInMemory(plan.errors);
  if (wholeFrameBytes(source, plan, memory) <= workingBytes(memory)) return {{window.y0, window.y1}};
  if (plan.base || plan.errors)
    fail(
        "{}: expected at least {} MB of memory, for a whole frame, which --method and --error need; found a limit of "
        "{} MB",
        source.path(),
        memoryThatSuffices(memory, [&](size_t limit) { return wholeFrameBytes(source, plan, limit); }) / 1'000'000 + 1,
        memory / 1'000'000);
  if (!plan.guide || !plan.guide->wholeFrame)
    return cutBands(source, Rows(source, images, guide.madePerPixel), halo, 0, memory);
  // A frame's guide is made while the last one's is still in use.
  const size_t fixed = window.area() * (guide.madePerPixel + guide.keptPerPixel) + guide.library;
  return cutBands(source, Rows(source, images, guide.keptPerPixel), halo, fixed, memory);
}

}  // namespace fathom::cli
