#include "deep/flat_attributes.h"

#include <OpenEXR/ImfChromaticitiesAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>

#include <memory>
#include <optional>
#include <set>
#include <span>

#include "flat/attribute_text.h"

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

// An attribute of as many numbers, or nothing where that is not the size of one.
template <class Attribute, class T>
std::unique_ptr<Imf::Attribute> typed(const std::vector<T>& values) {
  auto attribute = std::make_unique<Attribute>();
  if (values.size() * sizeof(T) != sizeof(attribute->value())) return {};
  std::copy(values.begin(), values.end(), reinterpret_cast<T*>(&attribute->value()));
  return attribute;
}

std::unique_ptr<Imf::Attribute> attributeOf(const std::string& name, const flat::AttributeValue& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return std::make_unique<Imf::StringAttribute>(*text);
  if (const auto* ints = std::get_if<std::vector<int>>(&value)) {
    for (const auto convert :
         {typed<Imf::IntAttribute, int>, typed<Imf::V2iAttribute, int>, typed<Imf::V3iAttribute, int>})
      if (auto attribute = convert(*ints)) return attribute;
    return {};
  }
  const auto& floats = std::get<std::vector<float>>(value);
  if (name == "chromaticities") return typed<Imf::ChromaticitiesAttribute>(floats);
  for (const auto convert :
       {typed<Imf::FloatAttribute, float>, typed<Imf::V2fAttribute, float>, typed<Imf::V3fAttribute, float>,
        typed<Imf::M33fAttribute, float>, typed<Imf::M44fAttribute, float>})
    if (auto attribute = convert(floats)) return attribute;
  return {};
}

// OpenImageIO has names of its own for some.
std::string exrName(const std::string& name) {
  static const std::map<std::string, std::string> names = {
      {"worldtocamera", "worldToCamera"}, {"worldtoscreen", "worldToNDC"}, {"PixelAspectRatio", "pixelAspectRatio"}};
  const auto found = names.find(name);
  return found == names.end() ? name : found->second;
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
  for (const auto& [key, text] : attributes) {
    const std::string name = exrName(key);
    const auto attribute = attributeOf(name, flat::parseAttribute(text));
    const auto present = header.find(name);
    if (!attribute || name.empty()) continue;
    const bool fits =
        present == header.end() || std::string_view(present.attribute().typeName()) == attribute->typeName();
    if (fits) header.insert(name, *attribute);
  }
  return Attributes(header);
}

}  // namespace fathom::deep
