#include "deep/exr_file.h"

namespace fathom::deep {

std::vector<PartInfo> readParts(const std::string& path) {
  return ExrFile(path).parts();
}

}  // namespace fathom::deep
