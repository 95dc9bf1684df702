// A chain of operations as its user writes it: images go on a stack, operations take them from there.
//
//   hero.####.exr smoke.####.exr --insert z=1.5 --clip 0 12 --flatten -o out.####.exr
//
// FILE [part=NAME]       puts an image on the stack
// --NAME [ARGUMENT...]   an operation (cli/operation.h): takes its images off the stack, and puts its result there.
//                        name=value, a flag's name alone, or the required ones by place
// --dup, --swap, --pop   the top of the stack twice; the two top images the other way round; without its top
// -o FILE [half=1]       writes the top, which stays
// --chain FILE           puts the words of a text file in this place; lines that begin with # are comments
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "cli/operation.h"
#include "cli/sequence.h"

namespace fathom::cli {

// An image of the chain: of a file, or an operation's result.
struct ChainNode {
  FilePattern file;  // of an image
  std::string part;
  const OperationSpec* operation = nullptr;  // null: an image
  std::map<std::string, std::string> arguments;
  std::vector<size_t> inputs;  // nodes before this one; the last was the top of the stack
};

struct ChainOutput {
  size_t node;
  FilePattern file;
  bool half = false;  // colours as HALF
};

struct Chain {
  std::vector<ChainNode> nodes;
  std::vector<ChainOutput> outputs;
};

// Throws Error: an operation that is not known, arguments that do not do, images that lack on the stack.
Chain parseChain(std::span<const std::string> words);

// The words of a chain's text: separated by white space, "quoted" where they hold some; a backslash takes the next
// character as it is. Throws Error where a quotation does not end.
std::vector<std::string> chainWords(const std::string& text);
// The text of words, an image or operation a line, that chainWords() reads back.
std::string chainText(std::span<const std::string> words);
// The words with those of the files that --chain names in their place. Throws Error where one cannot be read, or names
// itself.
std::vector<std::string> withChainFiles(std::span<const std::string> words);

}  // namespace fathom::cli
