#include "cli/sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <iterator>
#include <limits>
#include <optional>
#include <string_view>

#include "base/error.h"

namespace fathom::cli {

namespace {

constexpr int kMaxWidth = 18;
constexpr int64_t kMaxFrames = 1'000'000;  // a slip of the finger, not a film

struct Place {
  size_t begin, end;
  int width;
};

bool isDigit(char c) {
  return c >= '0' && c <= '9';
}

// The place for a number that starts at `i`, if one does.
std::optional<Place> placeAt(std::string_view path, size_t i) {
  size_t end = i;
  if (path[i] == '#') {
    end = std::min(path.find_first_not_of('#', i), path.size());
    return Place{i, end, int(end - i)};
  }
  if (path[i] != '%') return {};
  int width = 0;
  for (end = i + 1; end < path.size() && isDigit(path[end]) && width <= kMaxWidth; ++end)
    width = width * 10 + (path[end] - '0');
  const bool zeroPadded = end == i + 1 || path[i + 1] == '0';
  if (end >= path.size() || path[end] != 'd' || !zeroPadded) return {};
  return Place{i, end + 1, std::max(1, width)};
}

// One of "7" and "1-100x2"; `text` is not empty.
struct Range {
  int first, last, step;
};

std::optional<int> takeInt(std::string_view& text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return {};
  text.remove_prefix(size_t(end - text.data()));
  return value;
}

std::optional<Range> parseRange(std::string_view text) {
  const std::optional<int> first = takeInt(text);
  if (!first) return {};
  Range range{*first, *first, 1};
  if (text.starts_with('-')) {
    text.remove_prefix(1);
    const std::optional<int> last = takeInt(text);
    if (!last || *last < *first) return {};
    range.last = *last;
    if (text.starts_with('x')) {
      text.remove_prefix(1);
      const std::optional<int> step = takeInt(text);
      if (!step || *step < 1) return {};
      range.step = *step;
    }
  }
  return text.empty() ? std::optional(range) : std::nullopt;
}

// What is absent between the first and the last frame, given the smallest step between neighbours.
std::vector<int> holes(const std::vector<int>& frames) {
  int64_t step = std::numeric_limits<int64_t>::max();
  for (size_t i = 1; i < frames.size(); ++i) step = std::min(step, int64_t(frames[i]) - frames[i - 1]);
  std::vector<int> result;
  for (size_t i = 1; i < frames.size(); ++i)
    for (int64_t f = frames[i - 1] + step; f < frames[i] && int64_t(result.size()) < kMaxFrames; f += step)
      result.push_back(int(f));
  return result;
}

}  // namespace

std::string FilePattern::at(int frame) const {
  return numbered() ? fmt::format("{}{:0{}}{}", before, frame, width, after) : before;
}

std::string FilePattern::text() const {
  return before + std::string(size_t(width), '#') + after;
}

FilePattern parsePattern(const std::string& path) {
  const size_t name = path.find_last_of('/') == std::string::npos ? 0 : path.find_last_of('/') + 1;
  std::optional<Place> place;
  for (size_t i = name; i < path.size(); ++i) {
    const std::optional<Place> here = placeAt(path, i);
    if (!here) continue;
    if (place) fail("{}: expected one place for the frame number, found two", printable(path));
    if (here->width > kMaxWidth)
      fail("{}: expected at most {} digits, found {}", printable(path), kMaxWidth, here->width);
    place = here;
    i = here->end - 1;
  }
  if (!place) return {path, "", 0};
  return {path.substr(0, place->begin), path.substr(place->end), place->width};
}

std::vector<int> parseFrames(const std::string& text) {
  std::vector<int> frames;
  size_t begin = 0;
  while (begin <= text.size()) {
    const size_t comma = std::min(text.find(',', begin), text.size());
    const std::string part = text.substr(begin, comma - begin);
    const std::optional<Range> range = parseRange(part);
    if (!range)
      fail("frames {}: expected a form such as 7, 1-100 or 1-100x2, found '{}'", printable(text), printable(part));
    if ((int64_t(range->last) - range->first) / range->step + int64_t(frames.size()) >= kMaxFrames)
      fail("frames {}: expected at most {} frames", printable(text), kMaxFrames);
    for (int64_t f = range->first; f <= range->last; f += range->step) frames.push_back(int(f));
    begin = comma + 1;
  }
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  return frames;
}

std::vector<int> framesOnDisk(const FilePattern& pattern) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(pattern.before).parent_path();
  const std::string prefix = pattern.before.substr(pattern.before.find_last_of('/') + 1);
  std::vector<int> frames;
  std::error_code error;
  for (fs::directory_iterator it(folder.empty() ? "." : folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.size() <= prefix.size() + pattern.after.size()) continue;
    if (!name.starts_with(prefix) || !name.ends_with(pattern.after)) continue;
    std::string_view digits(name);
    digits = digits.substr(prefix.size(), name.size() - prefix.size() - pattern.after.size());
    const std::string_view whole = digits;
    const std::optional<int> frame = takeInt(digits);
    if (frame && digits.empty() && whole == fmt::format("{:0{}}", *frame, pattern.width)) frames.push_back(*frame);
  }
  if (error) fail("{}: expected a folder that can be read, found: {}", printable(folder.string()), error.message());
  std::sort(frames.begin(), frames.end());
  return frames;
}

std::optional<NumberedFile> findNumber(const std::string& path) {
  constexpr size_t kMostDigits = 9;                // what an int holds
  const size_t name = path.find_last_of('/') + 1;  // npos + 1 == 0
  for (size_t end = path.rfind('.'); end != path.npos && end > name; end = path.rfind('.', end - 1)) {
    size_t begin = end;
    while (begin > name && isDigit(path[begin - 1])) --begin;
    const bool alone = begin == name || std::string_view("._-").find(path[begin - 1]) != std::string_view::npos;
    if (begin == end || end - begin > kMostDigits || !alone) continue;
    NumberedFile file{{path.substr(0, begin), path.substr(end), int(end - begin)},
                      std::stoi(path.substr(begin, end - begin))};
    FilePattern unpadded = file.pattern;
    unpadded.width = 1;
    if (path[begin] != '0' && framesOnDisk(unpadded).size() > framesOnDisk(file.pattern).size())
      file.pattern = std::move(unpadded);
    return file;
  }
  return {};
}

Sequence findSequence(const std::string& path, const std::string& range) {
  Sequence sequence{parsePattern(path), {}, {}};
  if (!sequence.pattern.numbered()) {
    if (!range.empty())
      fail("{}: expected a name such as name.####.exr for frames {}, found a plain name", printable(path),
           printable(range));
    sequence.frames = {0};
    return sequence;
  }
  const std::vector<int> found = framesOnDisk(sequence.pattern);
  if (range.empty()) {
    sequence.frames = found;
    sequence.missing = holes(found);
  } else {
    const std::vector<int> wanted = parseFrames(range);
    std::set_intersection(wanted.begin(), wanted.end(), found.begin(), found.end(),
                          std::back_inserter(sequence.frames));
    std::set_difference(wanted.begin(), wanted.end(), found.begin(), found.end(), std::back_inserter(sequence.missing));
  }
  if (sequence.frames.empty())
    fail("{}: expected at least one frame{}, found none", printable(path),
         range.empty() ? "" : " of " + printable(range));
  return sequence;
}

std::string describeFrames(const std::vector<int>& frames) {
  std::string text;
  for (size_t i = 0; i < frames.size();) {
    size_t last = i;
    while (last + 1 < frames.size() && frames[last + 1] == frames[last] + 1) ++last;
    text += text.empty() ? "" : ", ";
    text += last == i ? fmt::format("{}", frames[i]) : fmt::format("{}-{}", frames[i], frames[last]);
    i = last + 1;
  }
  return text;
}

}  // namespace fathom::cli
