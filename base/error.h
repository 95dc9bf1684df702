// The one kind of error that bad input, bad files and full disks raise: a line with values, shown as it is by `fathom`.
#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>

namespace fathom {

// what() is one line without a final full stop, file first: "a.exr, part 1, channel Z: expected FLOAT, found UINT".
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

template <class... Args>
[[noreturn]] void fail(fmt::format_string<Args...> text, Args&&... args) {
  throw Error(fmt::format(text, std::forward<Args>(args)...));
}

// Another library's message as part of such a line: no line breaks, no full stop at the end.
inline std::string oneLine(std::string text) {
  for (char& c : text)
    if (c == '\n' || c == '\r') c = ' ';
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text;
}

// A name from a file, fit for a line of text: control characters become '?'.
inline std::string printable(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return text;
}

}  // namespace fathom
