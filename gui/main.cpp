// The `fathom-view` program.
#include <CLI/CLI.hpp>
#include <QApplication>
#include <string>
#include <vector>

#include "flat/error.h"
#include "gui/main_window.h"

int main(int argc, char** argv) {
  QApplication application(argc, argv);
  QApplication::setApplicationName("fathom-view");
  QApplication::setOrganizationName("fathom");
  CLI::App options("fathom-view: see what is inside a deep pixel");
  std::vector<std::string> files;
  options.set_version_flag("--version", "fathom-view " FATHOM_VERSION);
  options.add_option("files", files, "the image or sequence to look at, and one to compare it with")->expected(0, 2);
  CLI11_PARSE(options, argc, argv);
  fathom::gui::MainWindow window;
  try {
    if (!files.empty()) window.session().setA(fathom::gui::loadPicture(files[0]));
  } catch (const fathom::Error& e) {
    window.session().say(e.what());
  }
  window.show();
  return QApplication::exec();
}
