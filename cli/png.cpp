#include "cli/commands.h"

namespace fathom::cli {

void addPng(CLI::App&) {}

}  // namespace fathom::cli
