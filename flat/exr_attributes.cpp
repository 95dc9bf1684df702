#include "flat/exr_attributes.h"

#include <OpenEXR/ImfChromaticitiesAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>

#include <memory>
#include <string_view>

#include "flat/attribute_text.h"

namespace fathom::flat {

namespace {

// An attribute of as many numbers, or nothing where that is not the size of one.
template <class Attribute, class T>
std::unique_ptr<Imf::Attribute> typed(const std::vector<T>& values) {
  auto attribute = std::make_unique<Attribute>();
  if (values.size() * sizeof(T) != sizeof(attribute->value())) return {};
  std::copy(values.begin(), values.end(), reinterpret_cast<T*>(&attribute->value()));
  return attribute;
}

std::unique_ptr<Imf::Attribute> attributeOf(const std::string& name, const AttributeValue& value) {
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
  static const std::map<std::string, std::string> names = {{"worldtocamera", "worldToCamera"},
                                                           {"worldtoscreen", "worldToNDC"},
                                                           {"PixelAspectRatio", "pixelAspectRatio"},
                                                           {"DateTime", "capDate"},
                                                           {"ImageDescription", "comments"},
                                                           {"Copyright", "owner"},
                                                           {"ExposureTime", "expTime"},
                                                           {"FNumber", "aperture"},
                                                           {"XResolution", "xDensity"}};
  const auto found = names.find(name);
  return found == names.end() ? name : found->second;
}

}  // namespace

void addAttributes(const std::map<std::string, std::string>& attributes, Imf::Header& header) {
  for (const auto& [key, text] : attributes) {
    const std::string name = exrName(key);
    const auto attribute = attributeOf(name, parseAttribute(text));
    const auto present = header.find(name);
    if (!attribute || name.empty()) continue;
    const bool fits =
        present == header.end() || std::string_view(present.attribute().typeName()) == attribute->typeName();
    if (fits) header.insert(name, *attribute);
  }
}

}  // namespace fathom::flat
