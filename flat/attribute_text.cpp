#include "flat/attribute_text.h"

#include <fmt/format.h>

#include <charconv>
#include <optional>
#include <string_view>
#include <vector>

namespace fathom::flat {

namespace {

using OIIO::TypeDesc;

// The whole of `text` as a number, or nothing.
template <class T>
std::optional<T> parse(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

// Numbers separated by ", ", or nothing.
template <class T>
std::vector<T> parseList(std::string_view text) {
  std::vector<T> values;
  while (true) {
    const size_t comma = text.find(',');
    const std::optional<T> value = parse<T>(text.substr(0, comma));
    if (!value) return {};
    values.push_back(*value);
    if (comma == text.npos) return values;
    text.remove_prefix(comma + 1);
    if (text.starts_with(' ')) text.remove_prefix(1);
  }
}

std::string floatText(float value) {
  const std::string text = fmt::format("{}", value);
  return text.find_first_of(".en") == text.npos ? text + ".0" : text;
}

template <class T, class Text>
std::string listText(const OIIO::ParamValue& attribute, const Text& text) {
  const T* values = static_cast<const T*>(attribute.data());
  std::string result;
  for (size_t i = 0; i < attribute.type().basevalues(); ++i) result += (i ? ", " : "") + text(values[i]);
  return result;
}

// The type of that many numbers; nothing where an EXR has none.
std::optional<TypeDesc> listType(size_t count, TypeDesc::BASETYPE base) {
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

bool isNumbers(std::string_view text) {
  return !parseList<int>(text).empty() || !parseList<float>(text).empty();
}

// The text of an attribute, or nothing for types that are not carried.
std::optional<std::string> textOf(const OIIO::ParamValue& attribute) {
  if (attribute.type() == OIIO::TypeString) {
    std::string text = attribute.get_string();
    const bool ambiguous = isNumbers(text) || (text.starts_with('"') && text.ends_with('"'));
    return ambiguous ? '"' + text + '"' : text;
  }
  if (attribute.nvalues() != 1 || !listType(attribute.type().basevalues(), TypeDesc::FLOAT)) return {};
  switch (attribute.type().basetype) {
    case TypeDesc::INT:
      return listText<int>(attribute, [](int value) { return fmt::format("{}", value); });
    case TypeDesc::FLOAT:
      return listText<float>(attribute, floatText);
    default:
      return {};
  }
}

bool describesEncoding(std::string_view name) {
  for (const char* own : {"compression", "chunkCount", "name", "type", "version", "tiles", "lineOrder"})
    if (name == own) return true;
  return name.starts_with("oiio:") || name.starts_with("openexr:");
}

void addOne(const std::string& name, std::string_view text, OIIO::ImageSpec& spec) {
  const std::vector<int> ints = parseList<int>(text);
  const std::vector<float> floats = ints.empty() ? parseList<float>(text) : std::vector<float>();
  if (const auto type = listType(ints.size(), TypeDesc::INT)) {
    spec.attribute(name, *type, ints.data());
  } else if (const auto floatType = listType(floats.size(), TypeDesc::FLOAT)) {
    spec.attribute(name, *floatType, floats.data());
  } else {
    if (text.size() >= 2 && text.starts_with('"') && text.ends_with('"')) text = text.substr(1, text.size() - 2);
    spec.attribute(name, text);
  }
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

void addAttributes(const std::map<std::string, std::string>& attributes, OIIO::ImageSpec& spec) {
  for (const auto& [name, text] : attributes)
    if (!describesEncoding(name)) addOne(name, text, spec);
}

}  // namespace fathom::flat
