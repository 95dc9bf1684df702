#include "gui/compare_numbers.h"

#include <fmt/format.h>

#include "base/error.h"
#include "deep/clip_view.h"
#include "deep/compare.h"
#include "deep/tidy.h"

namespace fathom::gui {

namespace {

ComparedPart partOf(std::string name, const flat::Metrics& m) {
  return {std::move(name), m.relMse, m.mse, m.relMseTrimmed, m.psnr, m.smape, m.ssim};
}

// A deep image in the tidy form: itself, or what is put into `made`.
const deep::DeepImage& tidied(const deep::DeepImage& image, deep::DeepImage& made) {
  if (deep::isTidy(image)) return image;
  made = deep::tidy(image.copy()).image;
  return made;
}

const flat::Image& flattened(const Picture& picture, flat::Image& made) {
  if (picture.flat()) return *picture.flat();
  const Box& window = picture.dataWindow();
  made = deep::clipView(*picture.deep(), window, 1, {}, {"R", "G", "B"});
  made.dataWindow = window;
  made.displayWindow = picture.displayWindow();
  return made;
}

void noteExcluded(const char* what, size_t count, ComparedNumbers& numbers) {
  if (count > 0) numbers.notes.push_back(fmt::format("{} {} are not finite on one side and left out", count, what));
}

void addDeep(const deep::DeepMetrics& m, ComparedNumbers& numbers) {
  numbers.parts.push_back(partOf("flattened", m.flattened));
  numbers.parts.push_back({"per bin", m.bins.relMse, m.bins.mse, {}, {}, {}, {}});
  for (const deep::ClipMetrics& clip : m.clips) {
    if (clip.front) numbers.parts.push_back(partOf(fmt::format("in front of {:.4g}", clip.depth), *clip.front));
    if (clip.behind) numbers.parts.push_back(partOf(fmt::format("behind {:.4g}", clip.depth), *clip.behind));
  }
  noteExcluded("pixels", m.flattened.excluded, numbers);
  noteExcluded("bins", m.bins.excluded, numbers);
  if (m.bins.leftOut > 0)
    numbers.notes.push_back(fmt::format(
        "{:.2g} % of the alpha is in bins that fewer than 16 samples of the reference saw: left out per bin",
        100 * m.bins.leftOut));
}

// Nothing where the bins are not the same, which `why` says then.
std::optional<deep::DeepMetrics> compareBins(const Picture& image, const Picture& reference,
                                             const std::vector<float>& clips, std::string& why) {
  deep::DeepImage made[2];
  try {
    return deep::compare(tidied(*image.deep(), made[0]), tidied(*reference.deep(), made[1]), {.clips = clips});
  } catch (const Error& e) {
    why = e.what();
    return {};
  }
}

}  // namespace

ComparedNumbers compareNumbers(const Picture& image, const Picture& reference, const std::vector<float>& clips,
                               const Progress& progress) {
  progress.at(0);
  ComparedNumbers numbers;
  if (image.deep() && reference.deep()) {
    std::string why;
    if (const auto metrics = compareBins(image, reference, clips, why)) {
      addDeep(*metrics, numbers);
      return numbers;
    }
    numbers.notes.push_back("flattened only: " + why);
  }
  progress.at(0.2);
  flat::Image made[2];
  const flat::Image& a = flattened(image, made[0]);
  progress.at(0.4);
  const flat::Image& b = flattened(reference, made[1]);
  progress.at(0.6);
  const flat::Metrics metrics = flat::compare(a, b);
  numbers.parts.push_back(partOf("flattened", metrics));
  noteExcluded("pixels", metrics.excluded, numbers);
  return numbers;
}

}  // namespace fathom::gui
