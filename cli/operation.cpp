#include "cli/operation.h"

#include <charconv>
#include <cmath>

#include "base/error.h"

namespace fathom::cli {

namespace {

std::optional<double> parseNumber(const std::string& text) {
  double value = 0;
  const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || std::isnan(value)) return {};
  return value;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  for (size_t at = 0; at <= text.size();) {
    const size_t comma = std::min(text.find(',', at), text.size());
    parts.push_back(text.substr(at, comma - at));
    at = comma + 1;
  }
  return parts;
}

std::optional<std::vector<double>> parseNumbers(const std::string& text) {
  std::vector<double> values;
  for (const std::string& part : split(text)) {
    const auto value = parseNumber(part);
    if (!value) return {};
    values.push_back(*value);
  }
  return values;
}

bool isWhole(double value) {
  return value == std::floor(value) && std::abs(value) <= 2e9;
}

// What the type asks for, in words; empty where the text has it.
std::string expected(const ArgumentSpec& spec, const std::string& text) {
  const auto numbers = parseNumbers(text);
  switch (spec.type) {
    case ArgumentType::Number:
      return parseNumber(text) ? "" : "a number";
    case ArgumentType::Whole:
      return parseNumber(text) && isWhole(*parseNumber(text)) ? "" : "a whole number";
    case ArgumentType::Flag:
      return text == "0" || text == "1" ? "" : "0 or 1";
    case ArgumentType::Numbers:
      return numbers ? "" : "numbers with commas between them";
    case ArgumentType::Box:
      return numbers && numbers->size() == 4 && std::ranges::all_of(*numbers, isWhole) ? "" : "x,y,width,height";
    case ArgumentType::Text:
      break;
  }
  if (spec.choices.empty() || std::ranges::find(spec.choices, text) != spec.choices.end()) return "";
  std::string words;
  for (const std::string& choice : spec.choices) words += (words.empty() ? "" : ", ") + choice;
  return "one of " + words;
}

}  // namespace

Arguments::Arguments(std::string_view operation, std::span<const ArgumentSpec> specs,
                     std::map<std::string, std::string> given)
    : values_(std::move(given)) {
  for (auto& [name, value] : values_)  // line breaks, which a quoted formula may hold, would go on into errors
    std::ranges::replace_if(
        value, [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
  for (const auto& [name, value] : values_) {
    const auto spec = std::ranges::find(specs, name, &ArgumentSpec::name);
    if (spec == specs.end()) fail("{}: expected no argument {}, found {}={}", operation, name, name, value);
    if (const std::string wanted = expected(*spec, value); !wanted.empty())
      fail("{}: {}: expected {}, found {}", operation, name, wanted, value.empty() ? "nothing" : value);
  }
  for (const ArgumentSpec& spec : specs) {
    if (values_.contains(spec.name)) continue;
    if (spec.required) fail("{}: expected {} ({}), found nothing", operation, spec.name, spec.help);
    if (!spec.fallback.empty()) values_[spec.name] = spec.fallback;
  }
}

bool Arguments::has(const std::string& name) const {
  return values_.contains(name);
}
double Arguments::number(const std::string& name) const {
  return *parseNumber(text(name));
}
int Arguments::whole(const std::string& name) const {
  return int(number(name));
}
bool Arguments::flag(const std::string& name) const {
  return has(name) && text(name) == "1";
}
const std::string& Arguments::text(const std::string& name) const {
  return values_.at(name);
}
Box Arguments::box(const std::string& name) const {
  const std::vector<double> v = numbers(name);
  return {int(v[0]), int(v[1]), int(v[0] + v[2]), int(v[1] + v[3])};
}
std::vector<double> Arguments::numbers(const std::string& name) const {
  return *parseNumbers(text(name));
}
std::vector<std::string> Arguments::words(const std::string& name) const {
  return split(text(name));
}

std::span<const OperationSpec> operations() {
  static const std::vector<OperationSpec> table = [] {
    std::vector<OperationSpec> all;
    for (auto add :
         {addSampleOperations, addGeometryOperations, addVolumeOperations, addColourOperations, addAnalysisOperations})
      add(all);
    return all;
  }();
  return table;
}

const OperationSpec* findOperation(std::string_view name) {
  const auto found = std::ranges::find(operations(), name, &OperationSpec::name);
  return found == operations().end() ? nullptr : &*found;
}

Box dataWindowOf(const AnyImage& image) {
  return std::visit([](const auto& of) { return of.dataWindow; }, image);
}

}  // namespace fathom::cli
