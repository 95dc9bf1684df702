#include "deep/flat_attributes.h"

#include <OpenEXR/ImfChromaticitiesAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>

#include <optional>
#include <set>
#include <span>

#include "flat/attribute_text.h"
#include "flat/exr_attributes.h"

namespace fathom::deep {

namespace {

// The text of an attribute that holds values of T one after the other.
template <class Attribute, class T>
std::optional<std::string> textOf(const Imf::Attribute& attribute) {
  const auto* typed = dynamic_cast<const Attribute*>(&attribute);
  if (!typed) return {};
  static_assert(sizeof(typed->value()) % sizeof(T) == 0);
  const auto* first = reinterpret_cast<const T*>(&typed->value());
  return flat::attributeText(std::span(first, reinterpret_cast<const T*>(&typed->value() + 1)));
}

std::optional<std::string> textOf(const Imf::Attribute& attribute) {
  if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&attribute))
    return flat::attributeText(text->value());
  for (const auto convert :
       {textOf<Imf::IntAttribute, int>, textOf<Imf::V2iAttribute, int>, textOf<Imf::V3iAttribute, int>,
        textOf<Imf::FloatAttribute, float>, textOf<Imf::V2fAttribute, float>, textOf<Imf::V3fAttribute, float>,
        textOf<Imf::M33fAttribute, float>, textOf<Imf::M44fAttribute, float>,
        textOf<Imf::ChromaticitiesAttribute, float>})
    if (auto text = convert(attribute)) return text;
  return {};
}

}  // namespace

std::map<std::string, std::string> flatAttributes(const Attributes& attributes) {
  static const std::set<std::string> encoding = {"name", "type", "version", "chunkCount", "maxSamplesPerPixel"};
  std::map<std::string, std::string> result;
  const Imf::Header& header = attributes.header();
  for (auto it = header.begin(); it != header.end(); ++it) {
    if (encoding.contains(it.name())) continue;
    if (auto text = textOf(it.attribute())) result.emplace(it.name(), std::move(*text));
  }
  return result;
}

Attributes deepAttributes(const std::map<std::string, std::string>& attributes) {
  Imf::Header header;
  flat::addAttributes(attributes, header);
  return Attributes(header);
}

}  // namespace fathom::deep
