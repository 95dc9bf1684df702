#include "cli/commands.h"

namespace fathom::cli {

void addCompare(CLI::App&) {}

}  // namespace fathom::cli
