#include "cli/commands.h"

namespace fathom::cli {

void addInfo(CLI::App&) {}

}  // namespace fathom::cli
