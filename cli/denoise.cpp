#include "cli/commands.h"

namespace fathom::cli {

void addDenoise(CLI::App&) {}

}  // namespace fathom::cli
