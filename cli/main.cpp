// The `fathom` program: options, subcommands, and the only place where errors are caught.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <new>

#include "base/error.h"
#include "base/progress.h"
#include "cli/commands.h"

namespace {

enum Exit { kDone = 0, kFailed = 1, kUsage = 2 };

int run(int argc, char** argv) {
  CLI::App app("fathom: denoise and composite deep images");
  app.set_version_flag("--version", "fathom " FATHOM_VERSION);
  app.require_subcommand(1);
  using namespace fathom::cli;
  for (auto add : {addInfo, addConvert, addCluster, addDenoise, addModels, addTrain, addProgressive, addCompare, addPng,
                   addComp, addOperations})
    add(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const fathom::cli::Incomplete&) {
    return kFailed;
  } catch (const fathom::Cancelled&) {
    fmt::print(stderr, "fathom: stopped; the same command again does what is left\n");
    return fathom::cli::kInterrupted;
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "fathom: out of memory\n");
  } catch (const std::exception& e) {
    fmt::print(stderr, "fathom: {}\n", fathom::oneLine(e.what()));
  }
  return kFailed;
}
