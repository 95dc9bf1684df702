// Numbered files: a name such as `beauty.####.exr` or `beauty.%04d.exr`, the frames asked for, and those that are on
// disk.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace fathom::cli {

// A file name, plain or with one place for the frame number: a run of # (as many as the number has digits) or a printf
// form (%d, %04d). Only the last part of the path is looked at; folders are taken as they are.
struct FilePattern {
  std::string before, after;  // around the number; a plain file is all `before`
  int width = 0;              // digits at least, a minus sign counted in, as printf does it; 0: a plain file

  bool numbered() const { return width > 0; }
  std::string at(int frame) const;
  std::string text() const;  // as a user writes it, with #
};

// Throws Error where the name has more than one place for a number.
FilePattern parsePattern(const std::string& path);

// A file's name taken as that of a frame: "beauty.0042.exr" is number 42 of beauty.####.exr.
struct NumberedFile {
  FilePattern pattern;
  int frame;
};

// The last number of the name that stands between a dot, dash or underscore (or the name's beginning) and a dot. Where
// it does not say how many digits its neighbours have (10 after 9 or 09?), as most files beside it have it. Nothing
// where there is none.
std::optional<NumberedFile> findNumber(const std::string& path);

// "1-100x2", "7", "1,3,5-9", "-5-5": ascending, without repetitions. Throws Error with the part that it does not
// understand.
std::vector<int> parseFrames(const std::string& text);

// The numbers for which a file of that name exists, ascending. Names with other padding do not count.
std::vector<int> framesOnDisk(const FilePattern& pattern);

struct Sequence {
  FilePattern pattern;
  std::vector<int> frames;   // those that exist, ascending; {0} for a plain file
  std::vector<int> missing;  // those that ought to exist: asked for, or holes in the regular step of what is on disk
};

// The frames of `range` (see parseFrames), or where it is empty those on disk. A plain file takes no range and is not
// looked for. Throws Error where nothing is found.
Sequence findSequence(const std::string& path, const std::string& range = {});

// "1-4, 7, 9-11": for messages.
std::string describeFrames(const std::vector<int>& frames);

}  // namespace fathom::cli
