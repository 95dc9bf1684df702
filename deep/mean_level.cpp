#include "deep/mean_level.h"

#include <array>

#include "deep/flatten.h"

namespace fathom::deep {

void addLevel(const DeepImage& rows, flat::LevelSum& level) {
  const flat::Image flattened = flatten(rows);
  const flat::Plane& alpha = flattened.get("A");
  const std::array<const flat::Plane*, 3> rgb = {&flattened.get("R"), &flattened.get("G"), &flattened.get("B")};
  for (size_t i = 0; i < alpha.values.size(); ++i)
    for (const flat::Plane* plane : rgb)
      if (alpha.values[i] > 0) level.add(double(plane->values[i]));
}

}  // namespace fathom::deep
