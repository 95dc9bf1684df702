// How an operation is written: in help, in a chain, and as a subcommand of its own.
#pragma once

#include <string>
#include <vector>

#include "cli/operation.h"

namespace fathom::cli {

// "--clip NEAR FAR", "--merge [tidy]".
std::string usageOf(const OperationSpec& spec);
// A line for each argument.
std::string describeArguments(const OperationSpec& spec);
// All operations with their sentences.
std::string operationList();

// The words of a subcommand as those of a chain: images first, then the operation with its arguments, then the output.
// --name value and --name=value stand for name=value. Throws Error for an option that the operation does not have.
std::vector<std::string> chainOfOne(const OperationSpec& spec, const std::vector<std::string>& words);

}  // namespace fathom::cli
