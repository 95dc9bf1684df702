#include "gui/canvas.h"

#include <QMouseEvent>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "deep/sample_view.h"

namespace fathom::gui {

namespace {

constexpr size_t kWhole = size_t(9) << 20;  // pixels up to which a picture that is moved is composited whole
constexpr double kWheelStep = 240;          // eighths of a degree that double the size
constexpr double kClick = 4;                // units of the screen within which a press and its release are a click
constexpr double kReach = 6;                // from which the wipe's line can be taken
constexpr double kKept = 16;                // of the picture that cannot be moved out of sight

Box grown(const Box& box) {
  const int x = box.width() / 4, y = box.height() / 4;
  return {box.x0 - x, box.y0 - y, box.x1 + x, box.y1 + y};
}

bool holds(const Box& outer, const Box& inner) {
  return intersect(outer, inner) == inner;
}

// But for where, how bright and beside what: planes of the one are of use to the other.
bool showSame(const RenderRequest& a, const RenderRequest& b) {
  return a.a == b.a && a.b == b.b && a.overlay == b.overlay && a.state.layer == b.state.layer &&
         a.state.clip == b.state.clip;
}

int powerOfTwoUpTo(double value) {
  int power = 1;
  while (2 * power <= value) power *= 2;
  return power;
}

Box boxBetween(QPoint a, QPoint b) {
  return {std::min(a.x(), b.x()), std::min(a.y(), b.y()), std::max(a.x(), b.x()) + 1, std::max(a.y(), b.y()) + 1};
}

}  // namespace

Canvas::Canvas(Session& session, std::shared_ptr<const Display> display, QWidget* parent)
    : QWidget(parent), session_(session), renderer_(std::move(display)) {
  setMouseTracking(true);
  setFocusPolicy(Qt::StrongFocus);
  setAttribute(Qt::WA_OpaquePaintEvent);
  setMinimumSize(120, 80);
  connect(&renderer_, &Renderer::rendered, this, &Canvas::accept);
  connect(&renderer_, &Renderer::failed, this, &Canvas::refuse);
  connect(&session_, &Session::picturesChanged, this, &Canvas::follow);
  connect(&session_, &Session::draftChanged, this, &Canvas::follow);
  connect(&session_, &Session::viewChanged, this, &Canvas::follow);
  connect(&session_, &Session::pixelChanged, this, [this] { update(); });
  connect(&session_, &Session::boxChanged, this, [this] { update(); });
  follow();
}

bool Canvas::isCurrent() const {
  return shown_.request == asked_ && shown_.step == asked_.step;
}

Comparison Canvas::comparison() const {
  return comparisonOf({session_.a(), session_.b(), session_.view(), {}});
}

std::vector<Canvas::Pane> Canvas::panes() const {
  if (comparison() == Comparison::SideBySide) {
    const int half = width() / 2;
    return {{{0, 0, half, height()}, false}, {{half, 0, width() - half, height()}, true}};
  }
  return {{rect(), comparison() == Comparison::B}};
}

QPointF Canvas::inPane(QPointF widget) const {
  for (const Pane& pane : panes())
    if (widget.x() < pane.rect.right() + 1) return widget - pane.rect.topLeft();
  return widget - panes().back().rect.topLeft();
}

bool Canvas::isOnWipe(QPointF widget) const {
  return comparison() == Comparison::Wipe && std::abs(widget.x() - wipe_ * width()) <= kReach;
}

// What fit shows.
Box Canvas::frame() const {
  const PicturePtr& picture = session_.a() ? session_.a() : session_.b();
  if (!picture) return {};
  return picture->displayWindow().empty() ? picture->dataWindow() : picture->displayWindow();
}

RenderRequest Canvas::wanted() const {
  RenderRequest request{session_.a(), session_.b(), session_.view(), {}};
  Box all, seen;
  if (const auto& draft = session_.draft(); draft && draft->layer == request.state.layer) {
    request.a = draft->a;
    request.b = draft->b;
    request.overlay = draft->overlay;
    all = draft->overlay->window();
  }
  if (request.a) all = unionOf(all, request.a->dataWindow());
  if (request.b) all = unionOf(all, request.b->dataWindow());
  for (const Pane& pane : panes()) seen = unionOf(seen, viewport_.visible(pane.rect.size()));
  seen = intersect(seen, all);
  const int coarse = powerOfTwoUpTo(1 / zoom());
  while (request.step < coarse && seen.area() / size_t(request.step * request.step) > kWhole) request.step *= 2;
  request.shrink = coarse / request.step;
  const bool same = showSame(request, asked_);
  const bool stillThere = request.step == asked_.step && holds(all, asked_.box) && holds(asked_.box, seen);
  request.box = same && stillThere && !asked_.box.empty()        ? asked_.box
                : seen.empty() || (same && all.area() <= kWhole) ? all
                                                                 : intersect(grown(seen), all);
  return request;
}

void Canvas::setViewport(const Viewport& viewport) {
  const double before = viewport_.scale;
  viewport_ = viewport;
  // A corner of the picture stays in sight.
  const QRectF on = viewport_.toScreen(frame());
  const QSizeF pane = panes().front().rect.size();
  viewport_.origin +=
      {std::clamp(0.0, kKept - on.right(), std::max(kKept - on.right(), pane.width() - kKept - on.left())),
       std::clamp(0.0, kKept - on.bottom(), std::max(kKept - on.bottom(), pane.height() - kKept - on.top()))};
  request();
  update();
  if (viewport_.scale != before) emit zoomChanged(zoom());
}

void Canvas::fit() {
  fitted_ = true;
  framed_ = frame();
  setViewport(Viewport::fitted(framed_, panes().front().rect.size()));
}

void Canvas::zoomTo(double zoom) {
  const QSizeF pane = panes().front().rect.size();
  const QPointF fixed = mouse_ ? inPane(*mouse_) : QPointF(pane.width() / 2, pane.height() / 2);
  fitted_ = false;
  setViewport(viewport_.scaledTo(zoom / devicePixelRatioF(), fixed));
}

void Canvas::setWipe(double place) {
  wipe_ = std::clamp(place, 0.0, 1.0);
  update();
}

void Canvas::follow() {
  if (fitted_ || framed_ != frame())
    fit();
  else
    setViewport(viewport_);
}

void Canvas::request() {
  RenderRequest request = wanted();
  if (request == asked_) return;
  asked_ = request;
  if (!asked_.a && !asked_.b) shown_ = {};
  renderer_.request(std::move(request));
}

void Canvas::accept(const Rendered& result) {
  if (!asked_.a && !asked_.b) return;
  shown_ = result;
  update();
  if (isCurrent()) emit updated();
}

// A picture that cannot be shown leaves nothing on the screen, rather than the one before it.
void Canvas::refuse(const QString& reason) {
  if (shown_.request.a != asked_.a || shown_.request.b != asked_.b) shown_ = {};
  update();
  session_.say(reason);
}

void Canvas::point(QPointF widget) {
  const QPoint pixel = pixelAt(widget);
  Box reach = frame();
  if (session_.a()) reach = unionOf(reach, session_.a()->dataWindow());
  if (session_.b()) reach = unionOf(reach, session_.b()->dataWindow());
  session_.setCursor(reach.contains(pixel.x(), pixel.y()) ? std::optional(pixel) : std::nullopt);
}

void Canvas::cutAt(QPoint pixel) {
  const PicturePtr& picture = comparison() == Comparison::B ? session_.b() : session_.a();
  if (!picture || !picture->deep()) return;
  try {
    const std::optional<float> depth = deep::nearestDepth(*picture->deep(), pixel.x(), pixel.y());
    if (!depth) return;
    ViewState view = session_.view();
    view.clip.near = *depth;
    session_.setView(view);
  } catch (const Error& e) {
    session_.say(e.what());
  }
}

void Canvas::dragBox(QPointF to) {
  if (!moved_) return;
  session_.setBox(boxBetween(pixelAt(pressed_), pixelAt(to)));
}

void Canvas::click(QPointF at) {
  if (drag_ == Drag::Box) session_.setBox(std::nullopt);
  if (drag_ != Drag::Move) return;
  point(at);
  const std::optional<QPoint> pixel = session_.cursor();
  session_.setPin(session_.pin() == pixel ? std::nullopt : pixel);
}

void Canvas::resizeEvent(QResizeEvent*) {
  if (fitted_)
    fit();
  else
    setViewport(viewport_);
}

void Canvas::mousePressEvent(QMouseEvent* event) {
  const bool left = event->button() == Qt::LeftButton;
  if (drag_ != Drag::None || (!left && event->button() != Qt::MiddleButton)) return;
  pressed_ = event->position();
  before_ = viewport_;
  moved_ = false;
  drag_ = Drag::Move;
  if (!left) return;
  if (event->modifiers() & Qt::ShiftModifier) {
    drag_ = Drag::Box;
  } else if (event->modifiers() & (Qt::AltModifier | Qt::ControlModifier)) {
    drag_ = Drag::Near;
    cutAt(pixelAt(pressed_));
  } else if (isOnWipe(pressed_)) {
    drag_ = Drag::Wipe;
  }
}

void Canvas::mouseMoveEvent(QMouseEvent* event) {
  const QPointF at = event->position();
  mouse_ = at;
  moved_ = moved_ || (at - pressed_).manhattanLength() > kClick;
  if (drag_ == Drag::Move && moved_) {
    fitted_ = false;
    setViewport({before_.scale, before_.origin + at - pressed_});
  }
  if (drag_ == Drag::Wipe) setWipe(at.x() / width());
  if (drag_ == Drag::Box) dragBox(at);
  if (drag_ == Drag::Near) cutAt(pixelAt(at));
  if (drag_ == Drag::None) setCursor(isOnWipe(at) ? Qt::SplitHCursor : Qt::CrossCursor);
  point(at);
}

void Canvas::mouseReleaseEvent(QMouseEvent* event) {
  if (event->buttons() & (Qt::LeftButton | Qt::MiddleButton)) return;
  if (!moved_ && event->button() == Qt::LeftButton) click(event->position());
  drag_ = Drag::None;
}

void Canvas::wheelEvent(QWheelEvent* event) {
  fitted_ = false;
  setViewport(
      viewport_.scaledTo(viewport_.scale * std::exp2(event->angleDelta().y() / kWheelStep), inPane(event->position())));
  event->accept();
}

void Canvas::leaveEvent(QEvent*) {
  mouse_.reset();
  session_.setCursor(std::nullopt);
}

}  // namespace fathom::gui
