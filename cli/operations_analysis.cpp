#include "cli/operation.h"

namespace fathom::cli {

void addAnalysisOperations(std::vector<OperationSpec>& table) {
  (void)table;
}

}  // namespace fathom::cli
