// Work in other threads that fails: an exception of one line in the thread that waits, nothing half written, no end of the
// program.
#include <gmock/gmock.h>

#include <filesystem>
#include <memory>
#include <new>
#include <stdexcept>

#include "base/error.h"
#include "base/parallel.h"
#include "cli/chain_run.h"
#include "cli/denoise_job.h"
#include "deep/io.h"
#include "flat/io.h"
#include "flat/parallel_in_order.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::cli {
namespace {

using testing::ElementsAre;
using testing::UnorderedElementsAre;

std::vector<std::string> filesIn(const TemporaryFolder& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    names.push_back(entry.path().filename().string());
  return names;
}

// Fails in one of many tasks.
template <class Exception>
void failInParallel(const Exception& exception) {
  parallelFor(0, 64, [&](int i) {
    if (i == 40) throw exception;
  });
}

TEST(WorkerFailure, OfALoopIsThrownOn) {
  EXPECT_THROW(failInParallel(Error("a.exr: broken")), Error);
  EXPECT_THROW(failInParallel(std::bad_alloc()), std::bad_alloc);
}

TEST(WorkerFailure, OfAPipelineIsThrownOnAndNothingMoreIsTaken) {
  for (const int stage : {0, 1, 2}) {
    size_t alive = 0;
    {
      const auto thing = std::make_shared<int>();
      std::vector<size_t> taken;
      const auto fails = [stage](int here, size_t i) {
        if (here == stage && i == 5) throw Error("5");
      };
      const auto run = [&] {
        parallelPipeline(
            0, 100, 4,
            [&](size_t i) {
              fails(0, i);
              return std::shared_ptr<int>(thing);
            },
            [&](size_t i, std::shared_ptr<int> held) {
              fails(1, i);
              return held;
            },
            [&](size_t i, const std::shared_ptr<int>&) {
              fails(2, i);
              taken.push_back(i);
            });
      };
      EXPECT_THROW(run(), Error);
      EXPECT_LE(taken.size(), 5u);
      for (size_t i = 0; i < taken.size(); ++i) EXPECT_EQ(taken[i], i);
      alive = size_t(thing.use_count());
    }
    EXPECT_EQ(alive, 1u) << "of what was on the way";
  }
}

// A chain with an operation that fails in its last rows.
template <class Exception>
void runFailingChain(const TemporaryFolder& folder, const Exception& exception) {
  OperationSpec spec{"break", "", {ImageKind::Deep}, false, {}, {}, false, {}};
  spec.make = [&](const Arguments&, std::span<const InputForm>) {
    Operation operation;
    operation.apply = [&](std::vector<AnyImage> images) {
      if (dataWindowOf(images[0]).y1 == 16 && !dataWindowOf(images[0]).empty()) failInParallel(exception);
      return std::move(images[0]);
    };
    return operation;
  };
  Chain chain;
  chain.nodes.push_back({parsePattern(folder / "in.exr"), {}, nullptr, {}, {}});
  chain.nodes.push_back({{}, {}, &spec, {}, {0}});
  chain.outputs.push_back({0, parsePattern(folder / "first.exr"), false});
  chain.outputs.push_back({1, parsePattern(folder / "second.exr"), false});
  ChainRunParams params;
  params.bandRows = 4;
  runChain(chain, 0, params);
}

TEST(WorkerFailure, OfAChainLeavesNoOutput) {
  const TemporaryFolder folder;
  const Box window{0, 0, 9, 16};
  deep::write(folder / "in.exr",
              reference::randomDeep(window, window, {{"A", PixelType::Float}, {"Z", PixelType::Float}}));
  try {
    runFailingChain(folder, Error("5 apples: expected 6"));
    FAIL() << "expected an error";
  } catch (const Error& e) {
    EXPECT_EQ(std::string(e.what()), folder / "in.exr" + ": break: 5 apples: expected 6");
  }
  EXPECT_THROW(runFailingChain(folder, std::runtime_error("one\ntwo")), std::runtime_error);
  EXPECT_THROW(runFailingChain(folder, std::bad_alloc()), std::bad_alloc);
  EXPECT_THAT(filesIn(folder), ElementsAre("in.exr"));
}

class Silent : public ProgressSink {
 public:
  void at(double) override {}
  void frameDone(const std::string&) override {}
  void tell(const std::string& line) override { told.push_back(line); }
  std::vector<std::string> told;
};

TEST(WorkerFailure, OfAFrameIsItsErrorAndTheOthersAreMade) {
  const TemporaryFolder folder;
  for (const int frame : {1, 2, 3}) {
    flat::Image noisy = reference::makeNoisyFlat(20, 16, unsigned(frame)).noisy;
    noisy.add("A", 1);
    noisy.add("Z", 2);
    flat::write(folder / fmt::format("in.{}.exr", frame), noisy);
  }
  DenoiseRequest request;
  request.input = folder / "in.#.exr";
  request.output = folder / "out.#.exr";
  DenoiseJob job = makeDenoiseJob(request, findSequence(request.input), true);
  int run = 0;
  job.plan.base = BaseDenoiser{.denoise =
                                   [&](const flat::Image& noisy, const Progress&) {
                                     if (++run == 2) failInParallel(std::runtime_error("one\ntwo"));
                                     return noisy.copy();
                                   },
                               .settings = "test"};
  Silent sink;
  const std::vector<FrameReport> reports = denoiseSequence(std::move(job), sink, {});
  ASSERT_EQ(reports.size(), 3u);
  EXPECT_EQ(reports[0].status, FrameReport::Status::Done);
  EXPECT_EQ(reports[1].status, FrameReport::Status::Failed);
  EXPECT_EQ(reports[1].error, folder / "in.2.exr" + ": one two");
  EXPECT_EQ(reports[2].status, FrameReport::Status::Done);
  EXPECT_THAT(filesIn(folder), UnorderedElementsAre("in.1.exr", "in.2.exr", "in.3.exr", "out.1.exr", "out.3.exr"));
}

}  // namespace
}  // namespace fathom::cli
