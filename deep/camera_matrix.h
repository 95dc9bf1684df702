// The camera's matrices as an image's attributes hold them.
#pragma once

#include <ImathMatrix.h>

#include <optional>

#include "deep/attributes.h"

namespace fathom::deep {

// A matrix for row vectors, or nothing where the attribute is absent or of another type.
inline std::optional<Imath::M44d> matrixOf(const Attributes& attributes, const char* name) {
  const auto values = attributes.getMatrix(name);
  if (!values) return {};
  Imath::M44d matrix;
  for (size_t i = 0; i < 16; ++i) matrix[int(i / 4)][int(i % 4)] = double((*values)[i]);
  return matrix;
}

}  // namespace fathom::deep
