// Runs chains over files of a folder, as `fathom comp` does.
#pragma once

#include <string>
#include <vector>

#include "cli/chain_run.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::reference {

// A chain whose files are in the folder, its result in out.exr there; in bands of that many rows.
inline cli::ChainRunReport runChainIn(const TemporaryFolder& folder, std::vector<std::string> words, int bandRows) {
  for (std::string& word : words)
    if (word.ends_with(".exr")) word = folder / word;
  words.insert(words.end(), {"-o", folder / "out.exr"});
  cli::ChainRunParams params;
  params.bandRows = bandRows;
  return cli::runChain(cli::parseChain(words), 0, params);
}

// The bytes of what that writes.
inline std::string bytesOfChain(const TemporaryFolder& folder, const std::vector<std::string>& words, int bandRows) {
  runChainIn(folder, words, bandRows);
  return textOf(folder / "out.exr");
}

}  // namespace fathom::reference
