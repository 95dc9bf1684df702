#include "flat/oiio/attributes.h"

#include <optional>
#include <string_view>
#include <vector>

#include "flat/attribute_text.h"

namespace fathom::flat {

namespace {

using OIIO::TypeDesc;

// The type of that many numbers; nothing where an EXR has none.
std::optional<TypeDesc> typeOf(size_t count, TypeDesc::BASETYPE base) {
  switch (count) {
    case 1:
      return TypeDesc(base);
    case 2:
      return TypeDesc(base, TypeDesc::VEC2);
    case 3:
      return TypeDesc(base, TypeDesc::VEC3);
    case 8:
      return TypeDesc(base, 8);  // chromaticities
    case 9:
      return TypeDesc(base, TypeDesc::MATRIX33);
    case 16:
      return TypeDesc(base, TypeDesc::MATRIX44);
    default:
      return {};
  }
}

template <class T>
std::span<const T> valuesOf(const OIIO::ParamValue& attribute) {
  return {static_cast<const T*>(attribute.data()), attribute.type().basevalues()};
}

// The text of an attribute, or nothing for types that are not carried.
std::optional<std::string> textOf(const OIIO::ParamValue& attribute) {
  if (attribute.type() == OIIO::TypeString) return attributeText(attribute.get_string());
  if (attribute.nvalues() != 1 || !typeOf(attribute.type().basevalues(), TypeDesc::FLOAT)) return {};
  switch (attribute.type().basetype) {
    case TypeDesc::INT:
      return attributeText(valuesOf<int>(attribute));
    case TypeDesc::FLOAT:
      return attributeText(valuesOf<float>(attribute));
    default:
      return {};
  }
}

bool describesEncoding(std::string_view name) {
  for (const char* own : {"compression", "chunkCount", "name", "type", "version", "tiles", "lineOrder"})
    if (name == own) return true;
  return name.starts_with("oiio:") || name.starts_with("openexr:");
}

}  // namespace

std::map<std::string, std::string> attributesOf(const OIIO::ImageSpec& spec) {
  std::map<std::string, std::string> result;
  for (const OIIO::ParamValue& attribute : spec.extra_attribs) {
    const std::string name = attribute.name().string();
    if (describesEncoding(name)) continue;
    if (auto text = textOf(attribute)) result.emplace(name, std::move(*text));
  }
  return result;
}

}  // namespace fathom::flat
