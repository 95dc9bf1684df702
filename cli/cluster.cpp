#include "cli/commands.h"

namespace fathom::cli {

void addCluster(CLI::App&) {}

}  // namespace fathom::cli
