// Composites and colours what is looked at, in the background; the newest request wins.
#pragma once

#include <QObject>
#include <QString>
#include <memory>
#include <thread>

#include "gui/compositor.h"
#include "gui/newest.h"

namespace fathom::gui {

class Renderer : public QObject {
  Q_OBJECT

 public:
  explicit Renderer(std::shared_ptr<const Display> display, QObject* parent = nullptr);
  ~Renderer() override;

  // Never blocks. What waits is forgotten. Of what is under way only the quick answer is still given, so that a drag
  // shows something; the whole one stops at the next rows.
  void request(RenderRequest request);

 signals:
  // In the thread that the renderer lives in: a quick answer in coarser steps where the whole one would take long, then
  // the whole one. Never after the answer to a newer request.
  void rendered(const fathom::gui::Rendered& result);
  void failed(const QString& reason);

 private:
  void run(std::stop_token stop);
  void answer(const RenderRequest& request, const Progress& progress);
  void send(Rendered result);

  Compositor compositor_;  // the thread's
  Newest<RenderRequest> requests_;
  std::jthread thread_;
};

}  // namespace fathom::gui
