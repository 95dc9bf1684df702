// The subcommands of `fathom`: each file adds its own to the program. A command throws fathom::Error; main turns that
// into exit 1.
#pragma once

#include <CLI/CLI.hpp>

namespace fathom::cli {

void addInfo(CLI::App& app);
void addConvert(CLI::App& app);
void addCluster(CLI::App& app);
void addDenoise(CLI::App& app);
void addModels(CLI::App& app);
void addTrain(CLI::App& app);
void addProgressive(CLI::App& app);
void addCompare(CLI::App& app);
void addPng(CLI::App& app);
void addComp(CLI::App& app);
void addOperations(CLI::App& app);  // one each

// The exit status of a command that was told to stop.
constexpr int kInterrupted = 130;

// Thrown by a command that finished some of its work: its lines are printed, the exit status is 1.
struct Incomplete {};

}  // namespace fathom::cli
