#include "deep/channels.h"

namespace fathom::deep {

Role roleOf(std::string_view name, PixelType type) {
  if (type == PixelType::Uint) return Role::Identifier;
  if (name == "Z" || name == "ZBack") return Role::Depth;
  if (name == "A") return Role::Alpha;
  if (name == "samples" || name == "half0.samples" || name == "half1.samples") return Role::Statistic;
  if (name.starts_with("variance.")) return Role::Statistic;
  if (name.starts_with("half0.") || name.starts_with("half1.")) return Role::Half;
  if (name == "coc" || name == "time" || name.starts_with("lens.")) return Role::Plain;
  return Role::Premultiplied;
}

}  // namespace fathom::deep
