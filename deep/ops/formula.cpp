#include "deep/ops/formula.h"

#include <muParser.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace fathom::deep {

namespace {

constexpr const char* kNameCharacters = "0123456789_.abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";

bool isNameCharacter(char c) {
  return std::string_view(kNameCharacters).find(c) != std::string_view::npos;
}

bool isName(std::string_view text) {
  return !text.empty() && (text[0] == '_' || text[0] > '9') && std::ranges::all_of(text, isNameCharacter);
}

double clamped(double value, double low, double high) {
  return std::min(std::max(value, low), high);
}

double smoothstep(double low, double high, double value) {
  const double t = clamped((value - low) / (high - low), 0, 1);
  return t * t * (3 - 2 * t);
}

mu::Parser parserOf(const Assignment& assignment) {
  mu::Parser parser;
  parser.DefineNameChars(kNameCharacters);
  parser.DefineFun("clamp", clamped);
  parser.DefineFun("smoothstep", smoothstep);
  parser.DefineFun(
      "lerp", +[](double a, double b, double t) { return a + t * (b - a); });
  parser.DefineFun(
      "floor", +[](double value) { return std::floor(value); });
  parser.DefineFun(
      "ceil", +[](double value) { return std::ceil(value); });
  parser.DefineFun(
      "mod", +[](double a, double b) { return a - b * std::floor(a / b); });
  parser.SetExpr(assignment.formula);
  return parser;
}

// The library's message without the place in its own terms, for a line that names the place.
std::string messageOf(const mu::Parser::exception_type& error) {
  if (error.GetCode() == mu::ecINTERNAL_ERROR) return "an operator lacks a value";
  const std::string& text = error.GetMsg();
  const size_t end =
      std::min({text.size(), text.find(" found at"), text.find(" at position"), text.find(" at expression position")});
  return oneLine(text.substr(0, end));
}

// Without blanks around it, fit for a message.
std::string trimmed(std::string_view text) {
  constexpr const char* kBlank = " \t\r\n";
  const size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return printable(std::string(text.substr(first, text.find_last_not_of(kBlank) + 1 - first)));
}

[[noreturn]] void refuse(const Assignment& assignment, const mu::Parser::exception_type& error) {
  const size_t length = assignment.formula.size(), at = size_t(std::max(error.GetPos(), 0));
  fail("{} = {}: {}, at character {}", assignment.target, trimmed(assignment.formula), printable(messageOf(error)),
       assignment.at + std::min(at, length) + 1);
}

// The first = that is not part of a comparison.
size_t findAssign(std::string_view text) {
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '=') continue;
    if (i + 1 < text.size() && text[i + 1] == '=')
      ++i;
    else if (i == 0 || std::string_view("<>!").find(text[i - 1]) == std::string_view::npos)
      return i;
  }
  return std::string_view::npos;
}

Assignment parseAssignment(std::string_view text, size_t at) {
  const size_t assign = findAssign(text);
  if (assign == std::string_view::npos)
    fail("expected CHANNEL = FORMULA at character {}, found {}", at + 1, trimmed(text));
  const std::string target = trimmed(text.substr(0, assign)), formula(text.substr(assign + 1));
  if (!isName(target)) fail("expected the name of a channel at character {}, found {}", at + 1, trimmed(text));
  const size_t second = findAssign(formula);
  if (second != std::string_view::npos)
    fail("expected one = in {}, found another at character {}", trimmed(text), at + assign + 1 + second + 1);
  return {target, formula, at + assign + 1};
}

}  // namespace

std::vector<Assignment> parseAssignments(std::string_view text) {
  std::vector<Assignment> result;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find(';', at), text.size());
    const std::string_view one = text.substr(at, end - at);
    if (!trimmed(one).empty()) result.push_back(parseAssignment(one, at));
    at = end + 1;
  }
  if (result.empty()) fail("expected CHANNEL = FORMULA, found nothing");
  return result;
}

std::vector<std::string> namesIn(const Assignment& assignment) {
  try {
    mu::Parser parser = parserOf(assignment);
    std::vector<std::string> names;
    for (const auto& [name, value] : parser.GetUsedVar()) names.push_back(name);
    return names;
  } catch (const mu::Parser::exception_type& error) {
    refuse(assignment, error);
  }
}

size_t placeOf(const Assignment& assignment, const std::string& name) {
  const std::string& text = assignment.formula;
  size_t at = text.find(name);
  while (at != std::string::npos && ((at > 0 && isNameCharacter(text[at - 1])) ||
                                     (at + name.size() < text.size() && isNameCharacter(text[at + name.size()]))))
    at = text.find(name, at + 1);
  return assignment.at + (at == std::string::npos ? 0 : at) + 1;
}

struct Formula::Parser {
  explicit Parser(const Assignment& assignment) : parser(parserOf(assignment)) {}

  mu::Parser parser;
};

Formula::Formula(const Assignment& assignment, std::span<const std::string> names, std::span<double> values)
    : parser_(std::make_unique<Parser>(assignment)) {
  try {
    for (size_t i = 0; i < names.size(); ++i) parser_->parser.DefineVar(names[i], &values[i]);
    parser_->parser.Eval();
  } catch (const mu::Parser::exception_type& error) {
    refuse(assignment, error);
  }
  if (const int results = parser_->parser.GetNumResults(); results != 1)
    fail("{} = {}: expected one value, found {}", assignment.target, trimmed(assignment.formula), results);
}

Formula::Formula(Formula&&) noexcept = default;
Formula::~Formula() = default;

double Formula::evaluate() const {
  return parser_->parser.Eval();
}

}  // namespace fathom::deep
