#include "cli/operation.h"

namespace fathom::cli {

void addColourOperations(std::vector<OperationSpec>& table) {
  (void)table;
}

}  // namespace fathom::cli
