// One table of operations: what `fathom comp` can chain, and what is a subcommand of its own.
//
// An entry says what an operation takes, and makes it from its arguments. The operation itself is a function of
// deep/ or flat/; here it is told which rows it needs and what there is to say about it.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "cli/load_image.h"
#include "flat/box.h"

namespace fathom::cli {

enum class ImageKind { Deep, Flat, Any };

enum class ArgumentType { Number, Whole, Flag, Text, Box, Numbers };

struct ArgumentSpec {
  std::string name;  // written as name=value; a Flag alone, or name=0
  ArgumentType type;
  std::string fallback;  // the value where it is not given; empty: none
  std::string help;
  bool required = false;                  // may be given by place: `--clip 0 12` is `--clip near=0 far=12`
  std::vector<std::string> choices = {};  // of a Text; empty: anything
};

// The arguments of one operation, checked against their specs: of the right type, none unknown, none missing.
class Arguments {
 public:
  // `given`: by name. Throws Error with the operation's name, what was expected and what was found.
  Arguments(std::string_view operation, std::span<const ArgumentSpec> specs, std::map<std::string, std::string> given);

  bool has(const std::string& name) const;       // given, or with a default
  double number(const std::string& name) const;  // "inf" and "-inf" are numbers
  int whole(const std::string& name) const;
  bool flag(const std::string& name) const;
  const std::string& text(const std::string& name) const;
  Box box(const std::string& name) const;                         // "x,y,width,height"
  std::vector<double> numbers(const std::string& name) const;     // "0.1,2,3"
  std::vector<std::string> words(const std::string& name) const;  // a Text, split at commas

 private:
  std::map<std::string, std::string> values_;
};

struct Rows {
  int y0, y1;  // half-open
};

// An operation with its arguments, for one frame. All functions but `apply` may be empty.
struct Operation {
  // The result from whole images, or from bands of their rows: then only the rows that were asked for are taken of it.
  // Called from several threads at once, for different bands. Must work on images without rows, which is how the
  // channels of the result are found.
  std::function<AnyImage(std::vector<AnyImage> inputs)> apply = {};
  // The result's data window from the inputs'; empty: the first input's.
  std::function<Box(std::span<const Box> windows)> window = {};
  // The rows of one input that rows of the result are made of; empty: the same rows.
  std::function<Rows(size_t input, Rows result)> needs = {};
  // Where what is done depends on the whole image: called with every band of the first input, from the top, before `apply` is called with any rows. It costs a pass over the inputs: left empty where there is nothing
  // to find out.
  std::function<void(const AnyImage& band)> scan = {};
  // Called with every band of the result, from the top, by one thread: for what is made of an image beside an image.
  std::function<void(const AnyImage& band)> watch = {};
  // Lines for the user once the frame is done.
  std::function<std::vector<std::string>()> summary = {};
};

// What is known of an input before any of its rows.
struct InputForm {
  const AnyImage& image;  // without rows: display window, channels and attributes
  Box dataWindow;         // with them
};

struct OperationSpec {
  std::string name;               // "clip": `--clip` in a chain, `fathom clip` alone
  std::string help;               // a sentence or two for an artist
  std::vector<ImageKind> inputs;  // what it takes off the stack; the last one is the top
  bool more = false;              // takes any number of further inputs like the last: all that are on the stack
  std::vector<ArgumentSpec> arguments;
  // Throws Error where the arguments or the inputs do not do.
  std::function<Operation(const Arguments& arguments, std::span<const InputForm> inputs)> make;
  bool watches = false;  // makes something beside an image: a chain with it needs no -o
  // Which channels of an input it looks at; empty: all of all inputs.
  std::function<bool(size_t input, const std::string& channel)> reads = {};
};

// All operations, in the order in which help lists them. Each family has a file of its own.
std::span<const OperationSpec> operations();
const OperationSpec* findOperation(std::string_view name);

void addSampleOperations(std::vector<OperationSpec>& table);    // merge, clip, crop, tidy, flatten, ...
void addGeometryOperations(std::vector<OperationSpec>& table);  // transform, resize, insert, ...
void addVolumeOperations(std::vector<OperationSpec>& table);    // holdout, keymix, fog, deepen, ...
void addColourOperations(std::vector<OperationSpec>& table);    // grade, expression, recolour, shuffle
void addAnalysisOperations(std::vector<OperationSpec>& table);  // ids, stats, sample, points, ...

// For `apply`.
inline deep::DeepImage& deepOf(AnyImage& image) {
  return std::get<deep::DeepImage>(image);
}
inline const deep::DeepImage& deepOf(const AnyImage& image) {
  return std::get<deep::DeepImage>(image);
}
inline flat::Image& flatOf(AnyImage& image) {
  return std::get<flat::Image>(image);
}
inline const flat::Image& flatOf(const AnyImage& image) {
  return std::get<flat::Image>(image);
}
Box dataWindowOf(const AnyImage& image);

}  // namespace fathom::cli
