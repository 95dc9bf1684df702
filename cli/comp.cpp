// `fathom comp`, and every operation as a subcommand of its own: a chain of one.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "base/error.h"
#include "cli/chain_run.h"
#include "cli/claim.h"
#include "cli/commands.h"
#include "cli/content_hash.h"
#include "cli/frame_sink.h"
#include "cli/interrupt.h"
#include "cli/operation_words.h"
#include "cli/peak_memory.h"
#include "cli/progress_display.h"
#include "flat/output_file.h"

namespace fathom::cli {

namespace {

struct CompCommand {
  std::string frames, missing = "fail", stats, save;
  bool overwrite = false;
  int threads = 0;  // 0: all
  size_t memory = size_t(8) << 30;
};

constexpr const char* kFooter = R"(
fathom comp FILE... --OPERATION [ARGUMENT...] ... -o FILE

A chain reads from left to right. A file puts an image on the stack; an operation takes its images from the top of the
stack and puts its result there; -o writes the top, which stays. Arguments are name=value, flags by their name alone,
required ones also by place:

  fathom comp hero.####.exr smoke.####.exr --insert z=1.5 --clip 0 12 --flatten -o out.####.exr
  fathom comp hero.exr --dup --clip 0 5 -o front.exr --pop --clip 5 inf -o behind.exr

--dup doubles the top, --swap exchanges the two top images, --pop drops the top. A file takes part=NAME, -o takes half=1.
--chain FILE puts the words of a text file in its place; --save FILE writes such a file. `fathom NAME --help` tells more of
an operation.

Frames go through in bands of rows, so that they may be larger than memory. In a sequence, frames that this very chain has
made from these inputs are passed over.

Exit status: 0 all frames done, 1 some failed (one line each), 2 usage, 130 stopped.

Operations:
)";

// The frames of the first numbered image, or one.
Sequence framesOf(const Chain& chain, const std::string& range) {
  for (const ChainNode& node : chain.nodes)
    if (!node.operation && node.file.numbered()) return findSequence(node.file.text(), range);
  return {{}, {0}, {}};
}

// What decides a frame's result: the chain and what its images hold.
std::string hashOf(const std::string& text, const std::vector<std::string>& inputs) {
  ContentHash hash;
  hash.add(FATHOM_VERSION);
  hash.add(text);
  for (const std::string& input : inputs) hash.addFile(input);
  return fmt::format("{:016x}", hash.value());
}

struct FrameDone {
  int frame = 0;
  bool kept = false, elsewhere = false;
  std::string error;
  ChainRunReport report;
};

class CompRun {
 public:
  CompRun(const CompCommand& command, Chain chain, std::string text, Sequence sequence, std::stop_token stop)
      : command_(command),
        chain_(std::move(chain)),
        text_(std::move(text)),
        sequence_(std::move(sequence)),
        stop_(std::move(stop)) {}

  std::vector<FrameDone> run() {
    std::vector<FrameDone> done;
    ProgressDisplay display(sequence_.frames.size());
    std::vector<int> frames = sequence_.frames;
    for (size_t i = 0; i < frames.size(); ++i) {
      FrameDone frame = runFrame(frames[i], display);
      // What another process makes is looked at again behind all others.
      if (frame.elsewhere && i < sequence_.frames.size()) {
        frames.push_back(frames[i]);
        continue;
      }
      show(frame, display);
      if (command_.stats.empty()) frame.report = {};
      done.push_back(std::move(frame));
    }
    return done;
  }

 private:
  FrameDone runFrame(int frame, ProgressDisplay& display) {
    FrameDone done;
    done.frame = frame;
    try {
      ChainRunParams params;
      params.memory = command_.memory;
      if (sequence_.pattern.numbered()) {
        params.madeBy = hashOf(text_, inputFiles(chain_, frame));
        done.kept = !command_.overwrite && isDone(frame, params.madeBy);
      }
      if (done.kept) {
        Claim::clear(outputFiles(chain_, frame));
        return done;
      }
      const std::shared_ptr<const Claim> claim = claimOf(frame, params.madeBy, done);
      if (!done.kept && !done.elsewhere)
        done.report = runChain(chain_, frame, params, {[&](double fraction) { display.at(fraction); }, stop_});
    } catch (const Cancelled&) {
      throw;
    } catch (const std::bad_alloc&) {
      done.error = "out of memory";
    } catch (const std::exception& e) {
      done.error = oneLine(e.what());
    }
    return done;
  }

  // The claim on a frame of a sequence; what another process makes, or has made meanwhile, is noted.
  std::shared_ptr<const Claim> claimOf(int frame, const std::string& madeBy, FrameDone& done) const {
    const std::vector<std::string> files = outputFiles(chain_, frame);
    if (madeBy.empty() || files.empty()) return nullptr;
    std::shared_ptr<const Claim> claim = Claim::take(files);
    done.elsewhere = !claim;
    done.kept = claim && !command_.overwrite && isDone(frame, madeBy);
    return claim;
  }

  bool isDone(int frame, const std::string& madeBy) const {
    const std::vector<std::string> files = outputFiles(chain_, frame);
    return !files.empty() && std::ranges::all_of(files, [&](const std::string& file) {
      return standingOf(file, kChainMadeBy, madeBy) == Standing::Ours;
    });
  }

  // Results on the standard output, failures on the other; what is the same for every frame once.
  void show(const FrameDone& done, ProgressDisplay& display) {
    const bool several = sequence_.pattern.numbered();
    const std::string name = several ? fmt::format("frame {}: ", done.frame) : "";
    if (!done.error.empty()) return display.tell(fmt::format("fathom: {}{}", name, done.error));
    for (const std::string& note : done.report.notes)
      if (said_.insert(note).second) display.say(name + note);
    if (several)
      display.frameDone(fmt::format("{}{}", name,
                                    done.kept        ? "is there already"
                                    : done.elsewhere ? "another process is at it"
                                                     : "done"));
  }

  const CompCommand& command_;
  Chain chain_;
  std::string text_;
  Sequence sequence_;
  std::stop_token stop_;
  std::set<std::string> said_;
};

void writeStatistics(const std::string& path, const std::vector<FrameDone>& done) {
  nlohmann::json json{{"version", FATHOM_VERSION}, {"peakMemory", peakMemory()}, {"frames", nlohmann::json::array()}};
  for (const FrameDone& frame : done) {
    nlohmann::json entry{{"frame", frame.frame},
                         {"seconds", frame.report.seconds},
                         {"counts", frame.report.counts},
                         {"notes", frame.report.notes}};
    entry["status"] = !frame.error.empty() ? "failed" : frame.kept ? "kept" : frame.elsewhere ? "elsewhere" : "done";
    if (!frame.error.empty()) entry["error"] = frame.error;
    json["frames"].push_back(std::move(entry));
  }
  const std::string text = json.dump(2) + "\n";
  OutputFile file(path);
  file.append({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  file.finish();
}

void save(const std::string& path, const std::string& text) {
  OutputFile file(path);
  file.append({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  file.finish();
}

bool reportMissing(const CompCommand& command, const Sequence& sequence) {
  if (sequence.missing.empty()) return false;
  const bool failure = command.missing == "fail";
  fmt::print(stderr, "{}{}: {} missing: {}\n", failure ? "fathom: " : "", sequence.pattern.text(),
             sequence.missing.size() == 1 ? "frame" : "frames", describeFrames(sequence.missing));
  return failure;
}

// What is not understood is a usage error.
void asUsage(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& e) {
    throw CLI::ValidationError(e.what());
  }
}

bool watches(const Chain& chain) {
  return std::ranges::any_of(chain.nodes,
                             [](const ChainNode& node) { return node.operation && node.operation->watches; });
}

// That something comes out, and that every image's numbers have a place in the outputs' names.
void checkOutputs(const Chain& chain, const CompCommand& command) {
  const auto isNumbered = [](const ChainNode& node) { return !node.operation && node.file.numbered(); };
  const bool numbered = std::ranges::any_of(chain.nodes, isNumbered);
  if (chain.outputs.empty() && !watches(chain) && command.save.empty())
    fail("expected -o FILE, found a chain that writes nothing");
  if (!numbered && !command.frames.empty())
    fail("--frames: expected a sequence such as name.####.exr, found plain files");
  for (const ChainOutput& output : chain.outputs)
    if (output.file.numbered() != numbered)
      fail("-o: expected a {} name as the images have, found {}", numbered ? "numbered" : "plain", output.file.text());
}

// `makeWords`: the words of the chain; throws Error where they cannot be made.
void runWords(const CompCommand& command, const std::function<std::vector<std::string>()>& makeWords) {
  const Interrupt interrupt;
  const int threads = command.threads > 0 ? command.threads : int(std::max(1u, std::thread::hardware_concurrency()));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
  std::vector<std::string> words;
  Chain chain;
  asUsage([&] {
    words = withChainFiles(makeWords());
    chain = parseChain(words);
    checkOutputs(chain, command);
  });
  if (!command.save.empty()) save(command.save, chainText(words));
  if (chain.outputs.empty() && !watches(chain)) return;
  Sequence sequence = framesOf(chain, command.frames);
  const bool missing = reportMissing(command, sequence);
  CompRun run(command, std::move(chain), chainText(words), std::move(sequence), interrupt.token());
  const std::vector<FrameDone> done = run.run();
  if (!command.stats.empty()) writeStatistics(command.stats, done);
  if (missing || std::ranges::any_of(done, [](const FrameDone& frame) { return !frame.error.empty(); }))
    throw Incomplete();
}

void addCommonOptions(CLI::App& app, CompCommand& command) {
  const auto option = [&](const char* name, auto& value, const char* type, const std::string& text) {
    return app.add_option(name, value, text)->type_name(type);
  };
  option("--frames", command.frames, "RANGE", "1-100, 1-100x2 or 1,3,5-9 (default: all that are on disk)");
  option("--frames-missing", command.missing, "skip|fail", "Whether a missing frame is a failure; the others are done")
      ->check(CLI::IsMember({"skip", "fail"}).description(""))
      ->default_str(command.missing);
  option("--threads", command.threads, "N", "How many threads (default: all)")
      ->check(CLI::Range(1, 1024).description(""));
  option("--memory", command.memory, "SIZE", "How much memory; larger frames go through in bands of rows")
      ->transform(CLI::AsSizeValue(false).description(""))
      ->default_str("8G");
  option("--stats", command.stats, "FILE", "Write times, counts and memory as JSON");
  app.add_flag("--overwrite", command.overwrite, "Make frames of a sequence again that are there already");
}

}  // namespace

void addComp(CLI::App& app) {
  auto command = std::make_shared<CompCommand>();
  CLI::App* sub = app.add_subcommand("comp", "A chain of operations on deep and flat images, in one go");
  sub->allow_extras();
  addCommonOptions(*sub, *command);
  sub->add_option("--save", command->save, "Write the chain as a text file for --chain")->type_name("FILE");
  sub->footer([] { return kFooter + operationList(); });
  sub->callback([sub, command] { runWords(*command, [&] { return sub->remaining(); }); });
}

void addOperations(CLI::App& app) {
  for (const OperationSpec& spec : operations()) {
    auto command = std::make_shared<CompCommand>();
    CLI::App* sub = app.add_subcommand(spec.name, spec.help);
    sub->allow_extras();
    std::string images;
    for (const ImageKind kind : spec.inputs) images += kind == ImageKind::Flat ? " FLAT" : " IMAGE";
    std::string usage = usageOf(spec).substr(2 + spec.name.size());
    const std::string as = fmt::format("\nfathom {}{}{}{}{}\n", spec.name, images, spec.more ? "..." : "", usage,
                                       spec.watches ? " [-o FILE]" : " -o FILE");
    addCommonOptions(*sub, *command);
    sub->footer(as + "\nArguments (name=value or --name value):\n" + describeArguments(spec) +
                "  part=          Of an image: its part, by number or name\n");
    sub->callback([sub, command, &spec] { runWords(*command, [&] { return chainOfOne(spec, sub->remaining()); }); });
  }
}

}  // namespace fathom::cli
