#include "cli/operation.h"

namespace fathom::cli {

void addGeometryOperations(std::vector<OperationSpec>& table) {
  (void)table;
}

}  // namespace fathom::cli
