#include "deep/ops/insert.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "deep/channels.h"
#include "deep/ops/merge.h"
#include "deep/pick.h"

namespace fathom::deep {

namespace {

// Those that are wanted, those that it takes to merge, and one that tells, where both images have one, that samples have
// statistics: points at one depth are composited otherwise then.
std::vector<std::string> channelsOfPart(const DeepImage& frame, const DeepImage& other,
                                        std::vector<std::string> wanted) {
  for (const char* name : {"A", "Z", "ZBack"}) wanted.emplace_back(name);
  const auto statistic = std::ranges::find_if(
      frame.channels, [&](const Channel& c) { return describesSamples(roleOf(c)) && other.find(c.name); });
  if (statistic != frame.channels.end()) wanted.push_back(statistic->name);
  return wanted;
}

}  // namespace

DeepImage insert(const DeepImage& frame, DeepImage other, const Transform& placement, const std::stop_token& stop) {
  DeepImage placed = transform(std::move(other), placement);
  placed.displayWindow = frame.displayWindow;
  return merge(std::array{&frame, static_cast<const DeepImage*>(&placed)}, stop);
}

DeepImage insertPart(const DeepImage& frame, const DeepImage& other, const Transform& placement, const Box& box,
                     int step, const std::vector<std::string>& channels) {
  if (!placement.movesWholePixels())
    fail("insert: expected a move by whole pixels, found {}, {} and a scale of {}", placement.x, placement.y,
         placement.scale);
  const std::vector<std::string> names = channelsOfPart(frame, other, channels);
  const int x = int(std::lround(placement.x)), y = int(std::lround(placement.y));
  const DeepImage part = pick(frame, box, step, names);
  DeepImage placed = transform(pick(other, {box.x0 - x, box.y0 - y, box.x1 - x, box.y1 - y}, step, names),
                               {.z = placement.z, .zScale = placement.zScale});
  return merge(std::array{&part, static_cast<const DeepImage*>(&placed)});
}

std::vector<std::string> describeInsert(const DeepImage& frame, const DeepImage& other, const Transform& placement) {
  std::vector<DeepImage> forms;
  forms.push_back(rows(frame, frame.dataWindow.y0, frame.dataWindow.y0));
  forms.push_back(transform(rows(other, other.dataWindow.y0, other.dataWindow.y0), placement));
  return describeMerge(forms);
}

}  // namespace fathom::deep
