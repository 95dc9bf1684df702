// A chain made ready for one frame: what each node is like, and which rows of it the rows of others are made of.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "cli/chain.h"
#include "cli/chain_source.h"

namespace fathom::cli {

// How many bands are under way at once: one is read, one worked on, one written.
inline constexpr size_t kBandsAtOnce = 3;

// A node of the chain.
struct Stage {
  std::unique_ptr<ChainSource> source;  // of an image
  Operation operation;                  // of all others
  AnyImage form;                        // without rows
  Box window;
  std::string about;  // what errors begin with
};

// The next node's stage, after those of all nodes before it. An operation's form is left open: it shows once the
// operation has seen what it needs to (Operation::scan). Throws Error where the node's file cannot be read and where
// its inputs or arguments do not do.
Stage makeStage(const Chain& chain, std::span<const Stage> before, int frame, size_t memory);

// The rows of each node that a band of the nodes `targets` is made of; none where nobody needs it.
std::vector<std::optional<Rows>> rowsWanted(const Chain& chain, std::span<const Stage> stages,
                                            std::span<const size_t> targets, const Rows& band);

// Bands, from the top, over the rows of all targets: as high as `memory` allows where kBandsAtOnce of them are under
// way, or `bandRows` where that is not 0.
std::vector<Rows> planBands(const Chain& chain, std::span<const Stage> stages, std::span<const size_t> targets,
                            size_t memory, int bandRows);

// Those of the rows that are within the window.
Rows within(const Rows& rows, const Box& window);

// Calls what an operation does; its errors get the names of file and operation.
template <class Body>
auto named(const Stage& stage, const Body& body) {
  try {
    return body();
  } catch (const Error& e) {
    fail("{}: {}", stage.about, e.what());
  }
}

}  // namespace fathom::cli
