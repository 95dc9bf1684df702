#include "cli/operation.h"

namespace fathom::cli {

void addVolumeOperations(std::vector<OperationSpec>& table) {
  (void)table;
}

}  // namespace fathom::cli
