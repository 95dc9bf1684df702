#include "cli/commands.h"

namespace fathom::cli {

void addConvert(CLI::App&) {}

}  // namespace fathom::cli
