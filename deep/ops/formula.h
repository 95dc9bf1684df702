// A list of assignments as text, and its formulas made ready to be evaluated over and over.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace fathom::deep {

struct Assignment {
  std::string target;
  std::string formula;
  size_t at;  // of the formula in the text
};

// Assignments NAME = FORMULA with ; between them. Throws Error, with the place, where there is none, or one is no such.
std::vector<Assignment> parseAssignments(std::string_view text);

// The names in a formula that are no functions or constants. Throws Error where it cannot be understood.
std::vector<std::string> namesIn(const Assignment& assignment);

// Where a name stands in the whole text, counted from 1; for messages.
size_t placeOf(const Assignment& assignment, const std::string& name);

// A formula that reads its variables where they are. Of one thread; it takes some 10 us to make and 5 to 30 ns to
// evaluate. (muParser's bulk mode is slower: it starts OpenMP threads for each formula.)
class Formula {
 public:
  // `values` are those of `names`, and must stay where they are.
  Formula(const Assignment& assignment, std::span<const std::string> names, std::span<double> values);
  Formula(Formula&&) noexcept;
  ~Formula();
  double evaluate() const;

 private:
  struct Parser;
  std::unique_ptr<Parser> parser_;
};

}  // namespace fathom::deep
