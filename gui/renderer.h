// Composites and colours what is looked at, in the background; the newest request wins.
#pragma once

#include <QObject>
#include <QString>
#include <memory>

#include "gui/background.h"
#include "gui/compositor.h"

namespace fathom::gui {

class Renderer : public QObject {
  Q_OBJECT

 public:
  explicit Renderer(std::shared_ptr<const Display> display, QObject* parent = nullptr);

  // Never blocks. What waits is forgotten. Of what is under way a first answer is still given, so that a drag shows
  // something, but a whole one that takes long stops at the next rows. Without pictures there is no answer at all.
  void request(RenderRequest request);

 signals:
  // In the thread that the renderer lives in: a quick answer in coarser steps where the whole one would take long, then
  // the whole one. Never after the answer to a newer request.
  void rendered(const fathom::gui::Rendered& result);
  void failed(const QString& reason);

 private:
  void answerFirst(const RenderRequest& request);
  void answerWhole(const RenderRequest& request);

  Compositor compositor_;  // used in the background only
  bool whole_ = false;     // what runs is the second, whole answer
  Background background_;  // goes first, when its work is done
};

}  // namespace fathom::gui
