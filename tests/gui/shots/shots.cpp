// Screenshots of the real window, on the frames that the project's images have, or the bundled ones: to be looked at.
//
//   ./run shots, or under any X server: build/bin/view_shots OUTPUT_FOLDER [NAME]
#include <fmt/format.h>

#include <QApplication>
#include <QElapsedTimer>
#include <QPixmap>
#include <QThread>
#include <filesystem>
#include <string>

#include "deep/ops/transform.h"
#include "gui/canvas.h"
#include "gui/inspector_panel.h"
#include "gui/main_window.h"
#include "gui/theme.h"

namespace fathom::gui {
namespace {

void spin(int milliseconds) {
  QElapsedTimer timer;
  timer.start();
  while (timer.elapsed() < milliseconds) {
    QCoreApplication::processEvents(QEventLoop::AllEvents, 20);
    QThread::msleep(5);
  }
}

// The window once it has stopped changing.
QImage settled(MainWindow& window) {
  QImage before;
  for (int i = 0; i < 100; ++i) {
    spin(400);
    QImage now = window.grab().toImage();
    if (now == before && !window.jobs().busy()) return now;
    before = now;
  }
  return before;
}

class Shots {
 public:
  Shots(std::string folder, std::string only) : folder_(std::move(folder)), only_(std::move(only)) {}

  template <class Prepare>
  void take(const std::string& name, const std::string& a, const std::string& b, const Prepare& prepare) {
    if (!only_.empty() && only_ != name) return;
    MainWindow window;
    window.resize(1440, 900);
    window.show();
    window.frames().open(QString::fromStdString(a));
    if (!b.empty()) window.frames().openB(QString::fromStdString(b));
    for (int i = 0; i < 100 && !(window.session().a() && (b.empty() || window.session().b())); ++i) spin(100);
    settled(window);
    prepare(window);
    const std::string path = fmt::format("{}/{}.png", folder_, name);
    settled(window).save(QString::fromStdString(path));
    fmt::print("{}\n", path);
    std::fflush(stdout);
  }

 private:
  std::string folder_, only_;
};

template <class Change>
void changeView(MainWindow& window, const Change& change) {
  ViewState view = window.session().view();
  change(view);
  window.session().setView(view);
}

int run(const std::string& folder, const std::string& only) {
  const auto demo = [](const char* name) { return fmt::format("{}/{}", FATHOM_DEMO, name); };
  const auto render = [](const char* name) { return fmt::format("{}/renders/{}", FATHOM_SHARED, name); };
  std::filesystem::create_directories(folder);
  Shots shots(folder, only);
  const auto expose = [](float stops) {
    return [stops](MainWindow& window) { changeView(window, [&](ViewState& view) { view.display.exposure = stops; }); };
  };
  shots.take("main", demo("sequence.####.deep.exr"), "", expose(-1));
  if (!std::filesystem::exists(render(""))) return 0;
  shots.take("clipped", render("kitchen.deep.exr"), "", [&](MainWindow& window) {
    changeView(window, [&](ViewState& view) {
      view.clip.near = 3;
      view.clip.far = 6;
    });
  });
  shots.take("inspector", render("fur.deep.exr"), "", [&](MainWindow& window) {
    const Box& box = window.session().a()->dataWindow();
    window.session().setPin(QPoint((box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2));
  });
  shots.take("slice", render("staircase2.deep.exr"), "", [&](MainWindow& window) {
    window.session().setPin(QPoint(150, 100));
    changeView(window, [](ViewState& view) { view.layer = std::string("Z"); });
    window.findChild<InspectorPanel*>()->showTab(InspectorPanel::Tab::Slice);
  });
  shots.take("wipe", render("veach-ajar.deep.exr"), render("veach-ajar.ref.exr"), [&](MainWindow& window) {
    changeView(window, [](ViewState& view) { view.comparison = Comparison::Wipe; });
    window.showPanel("compare");
  });
  shots.take("error", render("veach-ajar.deep.exr"), render("veach-ajar.ref.exr"), [&](MainWindow& window) {
    changeView(window, [](ViewState& view) { view.comparison = Comparison::RelativeError; });
  });
  shots.take("values", demo("sequence.0001.deep.exr"), "", [&](MainWindow& window) {
    expose(-1)(window);
    window.session().setBox(Box{80, 40, 120, 60});
    window.findChild<InspectorPanel*>()->showTab(InspectorPanel::Tab::Box);
    window.findChild<Canvas*>()->zoomTo(64 * window.devicePixelRatioF());
  });
  shots.take("placed", demo("sequence.0001.deep.exr"), "", [&](MainWindow& window) {
    expose(-1)(window);
    window.placement().open(QString::fromStdString(demo("smoke.####.deep.exr")));
    settled(window);
    deep::Transform transform = window.placement().transform();
    transform.z = 1;
    window.placement().setTransform(transform);
    window.showPanel("place");
  });
  return 0;
}

}  // namespace
}  // namespace fathom::gui

int main(int argc, char** argv) {
  QApplication application(argc, argv);
  QApplication::setApplicationName("view_shots");  // its own settings
  QApplication::setOrganizationName("fathom");
  if (argc < 2) {
    fmt::print(stderr, "usage: {} OUTPUT_FOLDER [NAME]\n", argv[0]);
    return 2;
  }
  fathom::gui::applyTheme(application);
  return fathom::gui::run(argv[1], argc > 2 ? argv[2] : "");
}
