#include "gui/renderer.h"

#include <utility>

namespace fathom::gui {

namespace {

constexpr double kPatience = 0.03;  // seconds that the eye waits without a quick answer
constexpr int kCoarsest = 8;        // times the request's step

// How coarse the first answer has to be.
int firstStep(const Compositor& compositor, const RenderRequest& request) {
  int times = 1;
  while (times < kCoarsest && compositor.estimate(request, times * request.step) > kPatience) times *= 2;
  return times * request.step;
}

}  // namespace

Renderer::Renderer(std::shared_ptr<const Display> display, QObject* parent)
    : QObject(parent), compositor_(std::move(display)) {
  connect(&background_, &Background::failed, this, &Renderer::failed);
}

void Renderer::request(RenderRequest request) {
  const bool none = !request.a && !request.b;
  if (none || whole_) background_.clear();
  whole_ = false;
  if (!none) answerFirst(request);
}

void Renderer::answerFirst(const RenderRequest& request) {
  background_.run([this, request](const Progress& progress) -> Background::Deliver {
    const Rendered result = compositor_.make(request, firstStep(compositor_, request), progress);
    return [this, result] {
      const bool newer = background_.busy();
      if (result.step != result.request.step && !newer) answerWhole(result.request);
      emit rendered(result);
    };
  });
}

void Renderer::answerWhole(const RenderRequest& request) {
  whole_ = true;
  background_.run([this, request](const Progress& progress) -> Background::Deliver {
    const Rendered result = compositor_.make(request, request.step, progress);
    return [this, result] {
      whole_ = false;
      emit rendered(result);
    };
  });
}

}  // namespace fathom::gui
