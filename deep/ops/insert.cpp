#include "deep/ops/insert.h"

#include "deep/ops/merge.h"

namespace fathom::deep {

DeepImage insert(DeepImage frame, DeepImage other, const Transform& placement) {
  std::vector<DeepImage> images;
  images.push_back(std::move(frame));
  images.push_back(transform(std::move(other), placement));
  images[1].displayWindow = images[0].displayWindow;
  return merge(images);
}

std::vector<std::string> describeInsert(const DeepImage& frame, const DeepImage& other, const Transform& placement) {
  std::vector<DeepImage> forms;
  forms.push_back(rows(frame, frame.dataWindow.y0, frame.dataWindow.y0));
  forms.push_back(transform(rows(other, other.dataWindow.y0, other.dataWindow.y0), placement));
  return describeMerge(forms);
}

}  // namespace fathom::deep
