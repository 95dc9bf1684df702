// Several denoisers mixed, by the formula and by a network, as a user runs them. The weights are random: what is tested is
// that they are used as they should be.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "flat/io.h"
#include "flat/noise.h"
#include "tests/reference/compositional.h"
#include "tests/reference/mix_net.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class MixCommand : public testing::Test {
 protected:
  MixCommand() {
    std::filesystem::create_directory(folder_ / "models");
    writeModel("models/small.safetensors", reference::randomCompositional(16, 1));
    writeModel("models/mix.safetensors", reference::randomMix(1));
    flat::Image frame = reference::makeNoisyFlat(80, 50, 1).noisy;
    frame.add("A", 1);
    flat::write(folder_ / "in.exr", frame);
  }

  void writeModel(const std::string& name, const reference::PlainWeights& weights) const {
    const reference::Bytes bytes = reference::safetensors(weights);
    std::ofstream(folder_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  }
  Ran fathom(const std::string& arguments) const {
    return runFathom(arguments, "cd '" + folder_.path() + "'; FATHOM_MODELS=models");
  }
  flat::Image read(const std::string& name) const { return flat::read(folder_ / name); }
  bool same(const std::string& a, const std::string& b, const std::string& plane) const {
    return std::ranges::equal(read(a).get(plane).values, read(b).get(plane).values);
  }

  TemporaryFolder folder_;
};

TEST_F(MixCommand, ProgressiveTakesTheNetworkWhereItIs) {
  const std::string command = "progressive in.exr --base nlm,neural -o ";
  for (const char* mix : {"auto", "learned", "formula"}) {
    const Ran outcome = fathom(fmt::format("{}{}.exr --mix {}", command, mix, mix));
    ASSERT_EQ(outcome.status, 0) << outcome.err;
  }
  EXPECT_TRUE(same("auto.exr", "learned.exr", "G"));
  EXPECT_FALSE(same("auto.exr", "formula.exr", "G"));
  EXPECT_THAT(fathom(command + "auto.exr --overwrite").out, HasSubstr("done before"));
  std::filesystem::remove(folder_ / "models/mix.safetensors");
  ASSERT_EQ(fathom(command + "none.exr").status, 0);
  EXPECT_TRUE(same("none.exr", "formula.exr", "G"));
  const Ran missing = fathom(command + "missing.exr --mix learned");
  EXPECT_EQ(missing.status, 1);
  EXPECT_THAT(missing.err, HasSubstr("--mix learned: expected mix.safetensors in models; found none"));
  // Another network is another setting.
  writeModel("models/mix.safetensors", reference::randomMix(2));
  EXPECT_THAT(fathom(command + "learned.exr").err, HasSubstr("learned.exr: expected nothing there, or what these"));
}

TEST_F(MixCommand, OrderDoesNotMatter) {
  ASSERT_EQ(fathom("progressive in.exr --base nlm,neural -o one.exr").status, 0);
  ASSERT_EQ(fathom("progressive in.exr --base neural,nlm -o other.exr").status, 0);
  const flat::Image one = read("one.exr"), other = read("other.exr");
  for (size_t i = 0; i < one.dataWindow.area(); ++i)
    ASSERT_NEAR(one.get("G").values[i], other.get("G").values[i], 1e-4);
}

TEST_F(MixCommand, CandidatesAreWritten) {
  ASSERT_EQ(fathom("progressive in.exr --base nlm,neural -o out.exr --candidates made.exr").status, 0);
  const flat::Image made = read("made.exr");
  for (const char* base : {"nlm", "neural"})
    for (const char* what : {"R", "error.G", "variance.B", "covariance.R", "spread.G", "gate"})
      EXPECT_TRUE(made.find(fmt::format("{}.{}", base, what))) << base << what;
  ASSERT_EQ(fathom("denoise in.exr -o nlm.exr --method nlm --no-gate").status, 0);
  EXPECT_TRUE(std::ranges::equal(made.get("nlm.G").values, read("nlm.exr").get("G").values));
  // Also where the result is there already.
  std::filesystem::remove(folder_ / "made.exr");
  ASSERT_EQ(fathom("progressive in.exr --base nlm,neural -o out.exr --candidates made.exr").status, 0);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "made.exr"));
  EXPECT_EQ(fathom("progressive in.exr -o out.exr --candidates in.exr").status, 2);
}

TEST_F(MixCommand, DenoiseMixesAndTellsTheErrors) {
  const Ran outcome = fathom("denoise in.exr -o out.exr --method nlm,neural --error");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  ASSERT_EQ(fathom("progressive in.exr -o mix.exr --base nlm,neural --error").status, 0);
  EXPECT_TRUE(same("out.exr", "mix.exr", "R"));
  EXPECT_TRUE(same("out.exr", "mix.exr", "error.B"));
  EXPECT_TRUE(read("out.exr").find("A"));
  ASSERT_EQ(fathom("denoise in.exr -o plain.exr --method nlm,neural --threads 1").status, 0);
  EXPECT_TRUE(same("out.exr", "plain.exr", "G"));
  EXPECT_FALSE(read("plain.exr").find("error.B"));
}

TEST_F(MixCommand, RefusesWhatCannotBeMixed) {
  for (const auto& [options, text] :
       {std::pair("--method nlm,auto", "expected nlm, neural and oidn, or auto or layers alone"),
        {"--method nlm,nlm", "expected nlm once"},
        {"--method nlm,other", "found other"},
        {"--method nlm,neural --mix half", "--mix"}}) {
    const Ran outcome = fathom(fmt::format("denoise in.exr -o out.exr {}", options));
    EXPECT_EQ(outcome.status, 2) << options;
    EXPECT_THAT(outcome.err, HasSubstr(text));
  }
  const Ran small = fathom("denoise in.exr -o out.exr --method nlm,neural --memory 16M");
  EXPECT_EQ(small.status, 1);
  EXPECT_THAT(small.err, HasSubstr("MB of memory, for a whole frame"));
  flat::Image bare{{0, 0, 30, 30}, {0, 0, 30, 30}, {}, {}};
  for (const char* name : flat::kRgbNames) bare.add(name, 0.5f);
  flat::write(folder_ / "bare.exr", bare);
  const Ran unknown = fathom("denoise bare.exr -o out.exr --method nlm,neural");
  EXPECT_EQ(unknown.status, 1);
  EXPECT_THAT(unknown.err, HasSubstr("expected variance.* or half0.* and half1.* for a mix, found none"));
}

TEST_F(MixCommand, IsListed) {
  const Ran outcome = fathom("models");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("models/mix.safetensors"), HasSubstr("models/small.safetensors")));
}

}  // namespace
}  // namespace fathom
