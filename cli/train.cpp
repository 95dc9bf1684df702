// `fathom train`: starts the programs of nn/train on a studio's own renders.
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "cli/commands.h"

namespace fathom::cli {

namespace {

namespace fs = std::filesystem;

constexpr const char* kFooter = R"(
FOLDERS hold frames that were rendered twice: X.ref.exr, with very many samples per pixel, and beside it X.flat.exr or any
number of X.SPP.flat.exr, with few and with seeds of their own. Channels are those that `fathom denoise` reads: R, G, B, and
diffuse.*, specular.*, albedo.*, N.*, Z, variance.* and half0.*, half1.* as far as there are any. A folder is a scene; those
called fur, coffee and living-room are not trained on but measured.

Weights come to OUT/MODEL.safetensors, for `fathom denoise --method neural --model`, with a card that tells how they were
made. Stopped with Ctrl-C and started again, a training goes on where it was; with more --steps it goes on further, and
it takes in frames that were added meanwhile. A processor without help takes hours for small and days for base.

Needs Python 3 with PyTorch, and OpenImageIO's or OpenEXR's module (Debian: python3-torch python3-openimageio). What the
programs do, and all that can be changed, is in README.md beside them: FATHOM_TRAIN, or share/fathom/train beside the
program's folder, or nn/train in the source tree that it was built from.)";

struct TrainCommand {
  std::vector<std::string> folders;
  std::string out, model = "small", python = "python3", data;
  int steps = 60000, threads = 0;
};

// Where the programs are.
std::string trainingFolder() {
  std::vector<std::string> folders;
  if (const char* folder = std::getenv("FATHOM_TRAIN"); folder && *folder) {
    folders = {folder};
  } else {
    std::error_code none;
    const fs::path program = fs::read_symlink("/proc/self/exe", none);
    if (!none) folders.push_back((program.parent_path().parent_path() / "share/fathom/train").string());
    folders.emplace_back(FATHOM_SOURCE_TRAIN);
  }
  for (const std::string& folder : folders)
    if (fs::exists(folder + "/train.py")) return folder;
  fail("{}/train.py: expected the training's programs, found none", folders.back());
}

// Runs a program to its end; its exit status, 128 and the signal's number where one ended it.
int run(const std::vector<std::string>& words) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  pid_t child = 0;
  if (const int error = posix_spawnp(&child, arguments[0], nullptr, nullptr, arguments.data(), environ))
    fail("{}: cannot be started: {}", words[0], std::strerror(error));
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) fail("{}: lost: {}", words[0], std::strerror(errno));
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

void runTrain(const TrainCommand& command) {
  const std::string programs = trainingFolder();
  std::vector<std::string> train = {command.python, programs + "/train.py"};
  const auto add = [&](const std::string& option, const std::string& value) {
    train.push_back(option);
    train.push_back(value);
  };
  train.emplace_back("--data");
  train.insert(train.end(), command.folders.begin(), command.folders.end());
  add("--out", command.out);
  add("--width", command.model == "base" ? "32" : "16");
  add("--steps", std::to_string(command.steps));
  if (command.threads > 0) add("--threads", std::to_string(command.threads));
  if (__builtin_cpu_supports("avx512bf16")) train.emplace_back("--bfloat16");
  if (const int status = run(train)) fail("{}: ended with status {}", train[1], status);

  const std::string weights = fmt::format("{}/{}.safetensors", command.out, command.model);
  std::vector<std::string> write = {command.python, programs + "/export.py", command.out, weights};
  if (!command.data.empty()) {
    write.emplace_back("--data");
    write.push_back(command.data);
  }
  write.emplace_back("--frames");
  write.insert(write.end(), command.folders.begin(), command.folders.end());
  if (const int status = run(write)) fail("{}: ended with status {}", write[1], status);
  fmt::print("{}: fathom denoise IN -o OUT --method neural --model {}\n", weights, weights);
}

}  // namespace

void addTrain(CLI::App& app) {
  const auto command = std::make_shared<TrainCommand>();
  CLI::App* sub = app.add_subcommand("train", "Train the network on renders of your own");
  sub->add_option("FOLDERS", command->folders, "Folders with frames and references")
      ->required()
      ->check(CLI::ExistingDirectory);
  sub->add_option("-o,--output", command->out, "Folder for the training's state and the weights")
      ->required()
      ->type_name("OUT");
  sub->add_option("--model", command->model, "How large a network: 72 or 268 GFLOP per megapixel and light")
      ->type_name("small|base")
      ->check(CLI::IsMember({"small", "base"}).description(""))
      ->capture_default_str();
  sub->add_option("--steps", command->steps, "How many steps of eight crops")
      ->type_name("N")
      ->check(CLI::Range(1, 100'000'000).description(""))
      ->capture_default_str();
  sub->add_option("--threads", command->threads, "How many threads (default: all)")->type_name("N");
  sub->add_option("--data", command->data, "Words on where the frames come from, for the card")->type_name("TEXT");
  sub->add_option("--python", command->python, "The Python that has PyTorch")
      ->type_name("PROGRAM")
      ->capture_default_str();
  sub->footer(kFooter);
  sub->callback([command] { runTrain(*command); });
}

}  // namespace fathom::cli
