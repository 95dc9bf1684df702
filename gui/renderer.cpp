#include "gui/renderer.h"

#include <QMetaObject>
#include <utility>

namespace fathom::gui {

namespace {

constexpr double kPatience = 0.03;  // seconds that the eye waits without a quick answer
constexpr int kCoarsest = 8;        // times the request's step

}  // namespace

Renderer::Renderer(std::shared_ptr<const Display> display, QObject* parent)
    : QObject(parent),
      compositor_(std::move(display)),
      thread_([this](std::stop_token stop) { run(std::move(stop)); }) {}

Renderer::~Renderer() {
  thread_.request_stop();
  requests_.clear();
}

void Renderer::request(RenderRequest request) {
  if (request.a || request.b)
    requests_.put(std::move(request));
  else
    requests_.clear();
}

void Renderer::run(std::stop_token stop) {
  while (const auto taken = requests_.take(stop)) {
    try {
      answer(taken->value, {{}, taken->newer});
    } catch (const Cancelled&) {
    } catch (const std::exception& e) {
      const QString reason = QString::fromUtf8(e.what());
      QMetaObject::invokeMethod(
          this, [this, reason] { emit failed(reason); }, Qt::QueuedConnection);
    }
  }
}

void Renderer::answer(const RenderRequest& request, const Progress& progress) {
  int times = 1;
  while (times < kCoarsest && compositor_.estimate(request, times * request.step) > kPatience) times *= 2;
  if (times > 1) send(compositor_.make(request, times * request.step));
  send(compositor_.make(request, request.step, progress));
}

void Renderer::send(Rendered result) {
  QMetaObject::invokeMethod(
      this, [this, sent = std::move(result)] { emit rendered(sent); }, Qt::QueuedConnection);
}

}  // namespace fathom::gui
