// Deep compositing against oiiotool, program against program on the same files, and what of a chain is codec.
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "cli/chain_run.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/bench/measure.h"
#include "tests/bench/thicket.h"

namespace fathom::bench {
namespace {

constexpr int kWidth = 1920, kHeight = 1080, kRepeats = 3;

struct Spent {
  double seconds = 0, megabytes = 0;
  bool done = false;
};

// Runs a command of words without spaces, its output thrown away. What earlier ones wrote is on the disk by then.
Spent spend(const std::string& command) {
  sync();
  const auto start = std::chrono::steady_clock::now();
  const pid_t child = fork();
  if (child == 0) {
    execl("/bin/sh", "sh", "-c", ("exec " + command + " >/dev/null 2>&1").c_str(), nullptr);
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return {seconds, double(usage.ru_maxrss) / 1024, WIFEXITED(status) && WEXITSTATUS(status) == 0};
}

// The median time and the largest memory of each command, run in turn.
std::vector<Spent> spendInTurn(const std::vector<std::string>& commands) {
  std::vector<std::vector<double>> seconds(commands.size());
  std::vector<Spent> result(commands.size());
  for (int repeat = 0; repeat < kRepeats; ++repeat)
    for (size_t i = 0; i < commands.size(); ++i) {
      if (commands[i].empty()) continue;
      const Spent spent = spend(commands[i]);
      seconds[i].push_back(spent.seconds);
      result[i].done = spent.done;
      result[i].megabytes = std::max(result[i].megabytes, spent.megabytes);
    }
  for (size_t i = 0; i < commands.size(); ++i)
    if (!seconds[i].empty()) result[i].seconds = median(seconds[i]);
  return result;
}

Cell numberOr(bool has, double value) {
  return has ? Cell(value) : Cell("-");
}

Table programs(const std::string& a, const std::string& b, const std::string& folder) {
  const std::string fathom = FATHOM_BINARY, out = " -o " + folder + "/comp-out.exr";
  const std::vector<std::array<std::string, 3>> cases = {
      {"merge", fmt::format("{} merge {} {}{}", fathom, a, b, out),
       fmt::format("oiiotool {} {} --deepmerge{}", a, b, out)},
      {"flatten", fmt::format("{} flatten {}{}", fathom, a, out), fmt::format("oiiotool {} --flatten{}", a, out)},
      {"holdout", fmt::format("{} holdout {} {}{}", fathom, a, b, out),
       fmt::format("oiiotool {} {} --deepholdout{}", a, b, out)},
      {"holdout, hard", fmt::format("{} holdout {} {} hard opaque=1{}", fathom, a, b, out), ""},
      {"clip", fmt::format("{} clip {} 3 5{}", fathom, a, out), ""},
      {"copy", fmt::format("{} comp {}{}", fathom, a, out), fmt::format("oiiotool {}{}", a, out)},
  };
  std::vector<std::string> commands;
  for (const auto& one : cases) commands.insert(commands.end(), {one[1], one[2]});
  const std::vector<Spent> spent = spendInTurn(commands);
  Table table(fmt::format("Programs, {} x {}, 8 samples per pixel, {} threads", kWidth, kHeight,
                          std::thread::hardware_concurrency()),
              {"operation", "Fathom s", "oiiotool s", "times faster", "Fathom MB", "oiiotool MB", "share of memory"});
  for (size_t i = 0; i < cases.size(); ++i) {
    const Spent &ours = spent[2 * i], &theirs = spent[2 * i + 1];
    if (!ours.done) fmt::print(stderr, "{}: failed\n", cases[i][1]);
    table.add({cases[i][0], ours.seconds, numberOr(theirs.done, theirs.seconds),
               numberOr(theirs.done, theirs.seconds / ours.seconds), ours.megabytes,
               numberOr(theirs.done, theirs.megabytes), numberOr(theirs.done, ours.megabytes / theirs.megabytes)});
  }
  return table;
}

Table chain(const std::string& a, const std::string& b, const std::string& folder) {
  const std::string flat = folder + "/comp-flat.exr";
  const std::vector<std::string> words = {a, "--clip",  "0",         "6",  "--grade", "gain=1.2",
                                          b, "--merge", "--flatten", "-o", flat};
  const cli::Chain parsed = cli::parseChain(words);
  cli::runChain(parsed, 0, {});
  const flat::Image result = flat::read(flat);
  const std::vector<double> seconds = interleavedMedians({[&] { cli::runChain(parsed, 0, {}); },
                                                          [&] {
                                                            deep::read(a);
                                                            deep::read(b);
                                                            flat::write(flat, result);
                                                          }},
                                                         kRepeats);
  Table table("A chain: clip, grade, merge with another frame, flatten", {"what", "s"});
  table.add({"the chain", seconds[0]});
  table.add({"reading both frames and writing the result, alone", seconds[1]});
  table.add({"the chain / reading and writing alone", seconds[0] / seconds[1]});
  return table;
}

int run(const std::string& folder) {
  const std::string a = folder + "/comp-a.exr", b = folder + "/comp-b.exr";
  deep::write(a, thicket(kWidth, kHeight, 1));
  deep::write(b, thicket(kWidth, kHeight, 2));
  const std::vector<Table> tables = {programs(a, b, folder), chain(a, b, folder)};
  for (const Table& table : tables) table.print();
  writeJson(folder + "/comp.json", tables);
  for (const char* file : {"comp-a.exr", "comp-b.exr", "comp-out.exr", "comp-flat.exr"})
    std::filesystem::remove(folder + "/" + file);
  return 0;
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  if (argc != 3) {
    fmt::print(stderr, "usage: {} DEMO_FOLDER OUTPUT_FOLDER\n", argv[0]);
    return 2;
  }
  return fathom::bench::run(argv[2]);
}
