// Runs a chain of operations over one frame, in bands of rows: reading, working and writing at once. The result is the
// same bit for bit whatever the height of the bands and the number of threads.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/progress.h"
#include "cli/chain.h"

namespace fathom::cli {

struct ChainRunParams {
  size_t memory = size_t(8) << 30;  // bytes that all of it may take, flat inputs and PNGs aside
  int bandRows = 0;                 // rows of a band; 0: what the memory allows
  // Written into every EXR as the attribute kChainMadeBy; empty: none.
  std::string madeBy = {};
};
inline constexpr const char* kChainMadeBy = "fathom:comp";

struct ChainRunReport {
  std::vector<std::string> notes;          // lines for the user, by operation
  std::map<std::string, double> seconds;   // reading, working, writing: of threads that waited for one another
  std::map<std::string, uint64_t> counts;  // bands, samples read, samples written
};

// The files of the chain that hold its images or take its results, at a frame.
std::vector<std::string> inputFiles(const Chain& chain, int frame);
std::vector<std::string> outputFiles(const Chain& chain, int frame);

// `frame` fills in the places for numbers in the names of images and outputs, and in arguments called `file`. All outputs
// appear, each whole, or none. Throws Error and Cancelled.
ChainRunReport runChain(const Chain& chain, int frame, const ChainRunParams& params, const Progress& progress = {});

}  // namespace fathom::cli
