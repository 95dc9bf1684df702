// Operations that tell what is in an image: ids, points, sample, stats.
#include <fmt/format.h>

#include <atomic>
#include <charconv>
#include <memory>

#include "cli/operation.h"
#include "deep/ops/ids.h"
#include "flat/error.h"

namespace fathom::cli {

namespace {

// "3,7,0xdeadbeef"
std::vector<uint32_t> parseIds(const std::vector<std::string>& words) {
  std::vector<uint32_t> ids;
  for (const std::string& word : words) {
    const bool hexadecimal = word.starts_with("0x") || word.starts_with("0X");
    const char* end = word.data() + word.size();
    const auto [stop, error] =
        std::from_chars(word.data() + (hexadecimal ? 2 : 0), end, ids.emplace_back(), hexadecimal ? 16 : 10);
    if (error != std::errc() || stop != end) fail("ids: values: expected ids like 3,7,0xdeadbeef, found {}", word);
  }
  return ids;
}

Operation makeMatte(const Arguments& arguments) {
  if (arguments.has("ranks")) fail("ids: expected values or ranks, found both");
  const auto ids = parseIds(arguments.words("values"));
  const auto make = arguments.flag("each") ? deep::idMattes : deep::idMatte;
  return {.apply = [=, channel = arguments.text("channel")](std::vector<AnyImage> in) -> AnyImage {
    return make(deepOf(in[0]), channel, ids);
  }};
}

Operation makeIds(const Arguments& arguments, std::span<const InputForm>) {
  if (arguments.has("values")) return makeMatte(arguments);
  if (arguments.flag("each")) fail("ids: each: expected values, too, found none");
  const int ranks = arguments.has("ranks") ? arguments.whole("ranks") : 6;
  const auto most = std::make_shared<std::atomic<size_t>>(0);
  Operation operation;
  operation.apply = [=, channel = arguments.text("channel")](std::vector<AnyImage> in) -> AnyImage {
    deep::RankedIds ranked = deep::rankIds(deepOf(in[0]), channel, ranks);
    size_t before = *most;
    while (ranked.most > before && !most->compare_exchange_weak(before, ranked.most)) continue;
    return std::move(ranked.image);
  };
  operation.summary = [=]() -> std::vector<std::string> {
    if (*most <= size_t(ranks + ranks % 2)) return {};
    return {fmt::format("up to {} ids in a pixel: those of least coverage beyond {} ranks are left out", most->load(),
                        ranks + ranks % 2)};
  };
  return operation;
}

}  // namespace

void addAnalysisOperations(std::vector<OperationSpec>& table) {
  using enum ImageKind;
  using Type = ArgumentType;
  table.push_back({"ids",
                   "A matte of the samples with given ids, exact for hidden, soft and volumetric ones; or, without "
                   "values, all ids ranked by coverage, as Cryptomatte has them.",
                   {Deep},
                   false,
                   {{"values", Type::Text, "", "the ids, like 3,7,0xdeadbeef: their matte becomes A"},
                    {"each", Type::Flag, "0", "a channel for each of the values: id.3, id.7"},
                    {"channel", Type::Text, "id", "the channel with the ids (UINT)"},
                    {"ranks", Type::Whole, "", "without values: how many ids a pixel can have; 6 if not given"}},
                   makeIds});
}

}  // namespace fathom::cli
