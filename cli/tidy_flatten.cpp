#include "cli/commands.h"

namespace fathom::cli {

void addTidyAndFlatten(CLI::App&) {}

}  // namespace fathom::cli
