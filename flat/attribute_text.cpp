#include "flat/attribute_text.h"

#include <fmt/ranges.h>

#include <charconv>
#include <optional>

namespace fathom::flat {

namespace {

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

bool isQuoted(std::string_view text) {
  return text.size() >= 2 && text.starts_with('"') && text.ends_with('"');
}

}  // namespace

std::string attributeText(std::span<const int> values) {
  return fmt::format("{}", fmt::join(values, ", "));
}

std::string attributeText(std::span<const float> values) {
  std::string result;
  for (const float value : values) {
    const std::string text = fmt::format("{}", value);
    result += (result.empty() ? "" : ", ") + text + (text.find_first_of(".en") == text.npos ? ".0" : "");
  }
  return result;
}

std::string attributeText(std::string_view text) {
  const bool ambiguous = !parseList<int>(text).empty() || !parseList<float>(text).empty() || isQuoted(text);
  return ambiguous ? fmt::format("\"{}\"", text) : std::string(text);
}

AttributeValue parseAttribute(std::string_view text) {
  if (auto ints = parseList<int>(text); !ints.empty()) return ints;
  if (auto floats = parseList<float>(text); !floats.empty()) return floats;
  return std::string(isQuoted(text) ? text.substr(1, text.size() - 2) : text);
}

}  // namespace fathom::flat
