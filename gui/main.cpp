// The `fathom-view` program.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <QApplication>
#include <clocale>
#include <string>
#include <vector>

#include "gui/main_window.h"
#include "gui/theme.h"

int main(int argc, char** argv) {
  CLI::App options("fathom-view: see what is inside a deep pixel");
  std::vector<std::string> files;
  size_t memory = size_t(8) << 30;
  options.set_version_flag("--version", "fathom-view " FATHOM_VERSION);
  options.add_option("files", files, "the image or sequence to look at, and one to compare it with");
  options
      .add_option("--memory", memory,
                  "How much memory the pictures that are kept may take, a single file, and denoising, each; not what "
                  "panels make")
      ->transform(CLI::AsSizeValue(false).description(""))
      ->default_str("8G");
  // Help needs no display; all else has to wait until Qt has taken its own arguments.
  try {
    options.parse(argc, argv);
  } catch (const CLI::Success& e) {
    return options.exit(e);
  } catch (const CLI::ParseError&) {
  }
  QApplication application(argc, argv);
  std::setlocale(LC_NUMERIC, "C");  // which the line above has changed
  QApplication::setApplicationName("fathom-view");
  QApplication::setOrganizationName("fathom");
  CLI11_PARSE(options, argc, argv);
  QStringList names;
  for (const std::string& file : files) names << QString::fromStdString(file);
  const QStringList sources = fathom::gui::distinctSources(names);
  if (sources.size() > 2) {
    fmt::print(stderr, "fathom-view: expected at most two images or sequences, found {}\n", sources.size());
    return 1;
  }
  fathom::gui::applyTheme(application);
  fathom::gui::MainWindow window;
  window.restore();
  window.frames().cache().setLimit(memory);
  window.frameJobs().setMemory(memory);
  if (!sources.isEmpty()) window.frames().open(sources[0]);
  if (sources.size() > 1) window.frames().openB(sources[1]);
  window.show();
  return QApplication::exec();
}
