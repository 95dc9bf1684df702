// Any text as that of a chain: words that its own text gives back, and a chain or an Error; then the same words as those of a
// subcommand, and the operations of the chain on small images.
#include <tbb/global_control.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cli/chain.h"
#include "cli/operation_words.h"
#include "tests/fuzz/expect.h"

namespace fathom {
namespace {

constexpr size_t kMostPixels = 4096;

deep::DeepImage makeDeep() {
  const Box window{0, 0, 4, 3};
  deep::DeepImage image{window, {0, 0, 5, 5}, Buffer<uint64_t>(window.area() + 1, 0), {}, {}};
  for (size_t i = 0; i < window.area(); ++i) image.offsets[i + 1] = image.offsets[i] + i % 4;
  for (const char* name : {"R", "G", "B", "A", "Z", "ZBack"}) {
    deep::Channel& channel = image.add(name, deep::PixelType::Float);
    for (size_t i = 0; i < channel.values.size(); ++i)
      channel.values[i] = name[0] == 'Z' ? float(i % 3 + 1) + (name[1] ? 0.75f : 0.0f) : float(i % 5) / 4;
  }
  image.add("id", deep::PixelType::Uint).ids.fill(3);
  return image;
}

flat::Image makeFlat() {
  flat::Image image{{0, 0, 4, 3}, {0, 0, 5, 5}, {}, {}};
  for (const char* name : {"R", "G", "B", "A", "Z"}) image.add(name, 0.5f);
  return image;
}

cli::AnyImage imageFor(cli::ImageKind kind) {
  if (kind == cli::ImageKind::Flat) return makeFlat();
  return makeDeep();
}

// Makes a node's operation as a chain does, and runs it on images of the kinds that it takes.
void runOperation(const cli::ChainNode& node) {
  const cli::OperationSpec& spec = *node.operation;
  if (node.arguments.contains("file")) return;  // files are not for this
  std::vector<cli::AnyImage> images;
  for (size_t i = 0; i < node.inputs.size(); ++i)
    images.push_back(imageFor(spec.inputs[std::min(i, spec.inputs.size() - 1)]));
  std::vector<cli::InputForm> forms;
  std::vector<Box> windows;
  for (const cli::AnyImage& image : images) {
    windows.push_back(cli::dataWindowOf(image));
    forms.push_back({image, windows.back()});
  }
  const cli::Arguments arguments(spec.name, spec.arguments, node.arguments);
  const cli::Operation operation = spec.make(arguments, forms);
  const Box window = operation.window ? operation.window(windows) : windows[0];
  if (window.empty() || window.area() > kMostPixels) return;
  if (operation.needs)
    for (size_t i = 0; i < images.size(); ++i) operation.needs(i, {window.y0, window.y1});
  if (operation.scan) operation.scan(images[0]);
  if (!operation.apply) return;
  const cli::AnyImage result = operation.apply(std::move(images));
  if (operation.watch) operation.watch(result);
  if (operation.summary) operation.summary();
}

}  // namespace
}  // namespace fathom

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace fathom;
  static const tbb::global_control oneThread(tbb::global_control::max_allowed_parallelism, 1);
  fuzz::mayFail([&] {
    const std::vector<std::string> words = cli::chainWords(std::string(reinterpret_cast<const char*>(data), size));
    fuzz::expect(cli::chainWords(cli::chainText(words)) == words, "the same words from their own text");
    if (!words.empty())
      for (const cli::OperationSpec& spec : cli::operations())
        if (words[0].starts_with(spec.name))
          fuzz::mayFail([&] { cli::parseChain(cli::chainOfOne(spec, {words.begin() + 1, words.end()})); });
    const cli::Chain chain = cli::parseChain(words);
    for (const cli::ChainNode& node : chain.nodes)
      if (node.operation) fuzz::mayFail([&] { runOperation(node); });
  });
  return 0;
}
