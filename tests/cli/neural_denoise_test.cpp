// `fathom denoise --method neural`, `fathom models` and `fathom progressive` with the network, as a user runs them. The
// weights are random: what is tested is that the network is used as it should be, not how well it denoises.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "cli/base_denoiser.h"
#include "cli/frame_guide.h"
#include "cli/model_files.h"
#include "deep/flat_nl_means.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "nn/components.h"
#include "tests/reference/compositional.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/noisy_frame.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class NeuralDenoise : public testing::Test {
 protected:
  NeuralDenoise() {
    std::filesystem::create_directory(folder_ / "models");
    writeModel("models/small.safetensors", 1);
    flat::Image frame = reference::makeNoisyFlat(80, 50, 1).noisy;
    frame.add("A", 1);
    frame.add("Z", 2);
    flat::write(folder_ / "in.exr", frame);
  }

  void writeModel(const std::string& name, unsigned seed) const {
    reference::PlainWeights weights = reference::randomCompositional(16, seed);
    weights.metadata["licence"] = "none";
    weights.metadata["steps"] = "12";
    const reference::Bytes bytes = reference::safetensors(weights);
    std::ofstream(folder_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  }
  Ran fathom(const std::string& arguments) const {
    return runFathom(arguments, "cd '" + folder_.path() + "'; FATHOM_MODELS=models");
  }
  Ran run(const std::string& arguments) const { return fathom("denoise " + arguments); }
  flat::Image read(const std::string& name) const { return flat::read(folder_ / name); }
  std::string bytes(const std::string& name) const { return textOf(folder_ / name); }
  bool exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }

  TemporaryFolder folder_;
};

bool sameValues(const flat::Image& a, const flat::Image& b, const std::string& plane) {
  const Buffer<float>&x = a.get(plane).values, &y = b.get(plane).values;
  return std::equal(x.begin(), x.end(), y.begin(), y.end());
}

TEST_F(NeuralDenoise, DenoisesFlatFramesAndTheirComponents) {
  const Ran outcome = run("in.exr -o out.exr --method neural --stats stats.json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const flat::Image in = read("in.exr"), out = read("out.exr");
  const cli::BaseOptions options{.name = "neural", .model = folder_ / "models/small.safetensors"};
  const flat::Image expected = cli::makeBase(options, deep::planFlat(in, {}), 1'000'000'000).denoise(in, {});
  for (const std::string c : flat::kRgbNames)
    for (const std::string light : {"", "diffuse.", "specular."}) {
      EXPECT_TRUE(sameValues(out, expected, light + c)) << light << c;
      EXPECT_FALSE(sameValues(out, in, light + c)) << light << c;
    }
  EXPECT_TRUE(sameValues(out, in, "Z"));
  EXPECT_FALSE(out.find("half0.R") || out.find("variance.R"));
  const auto stats = nlohmann::json::parse(bytes("stats.json"));
  EXPECT_EQ(stats["total"]["counts"]["network pixels"], 2 * 80 * 52);
  EXPECT_EQ(stats["total"]["counts"]["network pixels skipped"], 0);
}

TEST_F(NeuralDenoise, KeepsAndSplitsAsAsked) {
  ASSERT_EQ(run("in.exr -o out.exr --method neural --split --keep").status, 0);
  EXPECT_TRUE(sameValues(read("out.exr"), read("in.exr"), "variance.G"));
  const flat::Image diffuse = read("out.diffuse.exr"), out = read("out.exr");
  EXPECT_TRUE(
      std::equal(diffuse.get("R").values.begin(), diffuse.get("R").values.end(), out.get("diffuse.R").values.begin()));
  EXPECT_TRUE(exists("out.specular.exr"));
}

TEST_F(NeuralDenoise, KnowsItsOwnOutputs) {
  const std::string command = "in.exr -o out.exr --method neural --components 2";
  ASSERT_EQ(run(command).status, 0);
  EXPECT_THAT(run(command).out, HasSubstr("done before"));
  EXPECT_THAT(run(command + " --memory 2G --threads 1 --model models/small.safetensors").out, HasSubstr("done before"));
  const std::string other = "in.exr -o out.exr --method neural --components 4";
  EXPECT_THAT(run(other).err, HasSubstr("out.exr: expected nothing there"));
  writeModel("models/small.safetensors", 2);
  EXPECT_THAT(run(command).err, HasSubstr("out.exr: expected nothing there"));
}

TEST_F(NeuralDenoise, ComponentsChangeTheResult) {
  for (const std::string components : {"1", "2", "4"})
    ASSERT_EQ(run(fmt::format("in.exr -o {0}.exr --base neural --components {0}", components)).status, 0);
  EXPECT_FALSE(sameValues(read("1.exr"), read("2.exr"), "R"));
  EXPECT_FALSE(sameValues(read("2.exr"), read("4.exr"), "R"));
  EXPECT_EQ(run("in.exr -o out.exr --method neural --components 3").status, 2);
}

TEST_F(NeuralDenoise, AModelThatCannotBeHadIsOneLine) {
  const auto expectLine = [&](const std::string& options, const std::string& text) {
    const Ran outcome = run("in.exr -o out.exr --method neural " + options);
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr(text));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_FALSE(exists("out.exr"));
  };
  expectLine("--model base", "--model base: expected base.safetensors in models");
  expectLine("--model none.safetensors", "none.safetensors");
  std::ofstream(folder_ / "models/base.safetensors") << "not at all";
  expectLine("--model base", "models/base.safetensors");
  std::filesystem::remove_all(folder_ / "models");
  expectLine("", "--model small: expected small.safetensors");
}

TEST_F(NeuralDenoise, TheBestQualityTakesTheLargeModel) {
  writeModel("models/base.safetensors", 2);
  ASSERT_EQ(run("in.exr -o best.exr --method neural --quality best").status, 0);
  ASSERT_EQ(run("in.exr -o base.exr --method neural --model base").status, 0);
  ASSERT_EQ(run("in.exr -o small.exr --method neural").status, 0);
  EXPECT_TRUE(sameValues(read("best.exr"), read("base.exr"), "R"));
  EXPECT_FALSE(sameValues(read("best.exr"), read("small.exr"), "R"));
}

TEST_F(NeuralDenoise, TheFirstFrameIsReadLikeTheOthers) {
  std::filesystem::copy(folder_ / "in.exr", folder_ / "pass.1.exr");
  std::filesystem::copy(folder_ / "in.exr", folder_ / "pass.2.exr");
  ASSERT_EQ(run("pass.#.exr -o out.#.exr --method neural").status, 0);
  EXPECT_TRUE(sameValues(read("out.1.exr"), read("out.2.exr"), "G"));
}

TEST_F(NeuralDenoise, GuidesDeepFrames) {
  deep::write(folder_ / "deep.exr", reference::makeNoisyFrame(40, 90, 1));
  ASSERT_EQ(run("deep.exr -o a.exr --method neural").status, 0);
  ASSERT_EQ(run("deep.exr -o b.exr --flat-guide neural --threads 1").status, 0);
  EXPECT_EQ(bytes("a.exr"), bytes("b.exr"));
  ASSERT_EQ(run("deep.exr -o none.exr --flat-guide none").status, 0);
  EXPECT_NE(bytes("a.exr"), bytes("none.exr"));
  const deep::DeepImage in = deep::read(folder_ / "deep.exr"), out = deep::read(folder_ / "a.exr");
  const auto a = in.get("A"), b = out.get("A");
  EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin(), b.end()));
}

TEST_F(NeuralDenoise, GuidesWhereOpenImageDenoiseIsNotFound) {
  deep::write(folder_ / "deep.exr", reference::makeNoisyFrame(40, 90, 1));
  const auto same = [&](const std::string& quality, const std::string& guide) {
    const Ran outcome = run("deep.exr -o auto.exr --overwrite --quality " + quality);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(run(fmt::format("deep.exr -o named.exr --overwrite --quality {} --flat-guide {}", quality, guide)).status,
              0);
    EXPECT_EQ(bytes("auto.exr"), bytes("named.exr")) << quality;
  };
  same("fast", "none");
  same("balanced", "neural");
  same("best", "neural");
  const Ran little = run("deep.exr -o auto.exr --overwrite --memory 8M");
  EXPECT_THAT(little.err, HasSubstr("deep.exr: no guide by the network: whole frames of it take more than the memory"));
  std::filesystem::remove_all(folder_ / "models");
  same("balanced", "none");
  same("best", "nlm");
}

// `small` is no gain as a guide.
TEST_F(NeuralDenoise, TheGuideIsBaseWhereNoModelIsNamed) {
  deep::write(folder_ / "deep.exr", reference::makeNoisyFrame(40, 40, 1));
  std::filesystem::copy(folder_ / "models/small.safetensors", folder_ / "models/base.safetensors");
  std::ofstream(folder_ / "models/small.safetensors") << "no weights";
  EXPECT_EQ(run("deep.exr -o named.exr --flat-guide neural --model base").status, 0);
  ASSERT_EQ(run("deep.exr -o guided.exr --flat-guide neural").status, 0);
  EXPECT_EQ(bytes("named.exr"), bytes("guided.exr"));
  EXPECT_EQ(run("in.exr -o flat.exr --method neural").status, 1);
}

// It errs more than what the defaults of a guide are for.
TEST_F(NeuralDenoise, BinsFollowItAsANetworkOfOurs) {
  deep::write(folder_ / "deep.exr", reference::makeNoisyFrame(40, 40, 1));
  cli::FrameInputs inputs;
  inputs.main = folder_ / "deep.exr";
  cli::FrameSource source(inputs, {});
  deep::DenoisePlan plan;
  plan.inputs.variance = true;
  std::set<std::string> notes;
  const cli::BaseOptions network{.model = folder_ / "models/small.safetensors"};
  const std::optional<cli::GuidePlan> guide = cli::planGuide("neural", network, plan, source, size_t(1) << 30, notes);
  ASSERT_TRUE(guide);
  EXPECT_EQ(guide->denoisers.consistency.mix.prior, deep::kNetworkGuide.mix.prior);
  EXPECT_EQ(guide->denoisers.consistency.binPrior, deep::kNetworkGuide.binPrior);
}

TEST_F(NeuralDenoise, AutoTakesOneOfThem) {
  const Ran outcome = run("in.exr -o auto.exr --method auto");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("which promises the least error"));
  const std::string taken = outcome.err.find("denoised by neural") != std::string::npos ? "neural" : "nlm";
  ASSERT_EQ(run("in.exr -o named.exr --method " + taken).status, 0);
  EXPECT_EQ(bytes("auto.exr"), bytes("named.exr"));
  std::filesystem::remove_all(folder_ / "models");
  EXPECT_THAT(run("in.exr -o alone.exr --method auto").err, HasSubstr("denoised by nlm, which is all that there is"));
}

TEST_F(NeuralDenoise, ErrorsAndProgressWork) {
  ASSERT_EQ(run("in.exr -o out.exr --method neural --error").status, 0);
  EXPECT_TRUE(read("out.exr").find("error.R"));
  for (const char* method : {"neural", "auto"}) {
    const Ran outcome = fathom(fmt::format("progressive in.exr -o {0}.exr --method {0}", method));
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("estimated relMSE"));
  }
  EXPECT_THAT(fathom("progressive in.exr -o neural.exr --method neural --components 4").err,
              HasSubstr("expected nothing there"));
}

// What is said to do does.
TEST_F(NeuralDenoise, ItsMemoryCounts) {
  const Ran outcome = run("in.exr -o out.exr --method neural --memory 6M");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("in.exr: expected at least"), HasSubstr("for a whole frame")));
  const size_t at = outcome.err.find("at least ") + 9;
  const std::string enough = outcome.err.substr(at, outcome.err.find(" MB", at) - at);
  EXPECT_EQ(run("in.exr -o out.exr --method neural --memory " + enough + "M").status, 0) << enough;
}

TEST_F(NeuralDenoise, HasItsPlaceInATimeBudget) {
  const Ran outcome = run("in.exr -o out.exr --method neural --time-budget 1000");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("1000 s a frame allow --quality fast --method neural --components 4"));
  EXPECT_THAT(run("in.exr -o out.exr --quality fast --method neural --components 4").out, HasSubstr("done before"));
  EXPECT_THAT(run("in.exr -o two.exr --method neural --components 2 --time-budget 1000").err,
              HasSubstr("allow --quality fast --method neural --components 2"));
  const Ran automatic = run("in.exr -o auto.exr --method auto --time-budget 1000");
  ASSERT_EQ(automatic.status, 0) << automatic.err;
  EXPECT_THAT(run("in.exr -o auto.exr --method auto --time-budget 1000").out, HasSubstr("done before"));
  deep::write(folder_ / "deep.exr", reference::makeNoisyFrame(40, 40, 1));
  EXPECT_THAT(run("deep.exr -o d.exr --flat-guide neural --time-budget 1000").err,
              HasSubstr("1000 s a frame allow --quality best --flat-guide neural, about"));
}

// Coefficients with which every block is worth as many components as can be, or one.
TEST_F(NeuralDenoise, ComponentsAreThoseThatTilesAreWorth) {
  const auto write = [&](const std::string& first) {
    reference::PlainWeights weights = reference::randomCompositional(16, 1);
    std::string zeros;
    for (size_t i = 1; i < nn::kBlockStatistics; ++i) zeros += " 0";
    weights.metadata["components.gain2"] = fmt::format("0{}", zeros);
    weights.metadata["components.gain4"] = fmt::format("{}{}", first, zeros);
    const reference::Bytes bytes = reference::safetensors(weights);
    std::ofstream(folder_ / "models/small.safetensors", std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  };
  for (const auto& [gain, components] : {std::pair("0.4", "4"), std::pair("-0.4", "1")}) {
    write(gain);
    ASSERT_EQ(run("in.exr -o auto.exr --method neural --overwrite --stats stats.json").status, 0);
    ASSERT_EQ(run(fmt::format("in.exr -o fixed.exr --method neural --overwrite --components {}", components)).status,
              0);
    EXPECT_TRUE(sameValues(read("auto.exr"), read("fixed.exr"), "R")) << gain;
    const auto counts = nlohmann::json::parse(bytes("stats.json"))["total"]["counts"];
    EXPECT_EQ(counts["network pixels in 4 components"], components == std::string("4") ? 2 * 80 * 52 : 0);
  }
}

TEST_F(NeuralDenoise, ProgressiveKeepsItWithinTheMemory) {
  const Ran outcome = fathom("progressive in.exr -o out.exr --method neural --memory 6M");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("in.exr: expected at least"));
  EXPECT_FALSE(exists("out.exr"));
  const size_t at = outcome.err.find("at least ") + 9;
  const std::string enough = outcome.err.substr(at, outcome.err.find(" MB", at) - at);
  EXPECT_EQ(fathom("progressive in.exr -o out.exr --method neural --memory " + enough + "M").status, 0) << enough;
}

TEST_F(NeuralDenoise, ModelsAreListed) {
  const Ran outcome = fathom("models");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("random"), HasSubstr("models/small.safetensors"), HasSubstr("none")));
  std::ofstream(folder_ / "models/base.safetensors") << "not at all";
  const Ran damaged = fathom("models");
  EXPECT_EQ(damaged.status, 1);
  EXPECT_THAT(damaged.out, HasSubstr("models/small.safetensors"));
  EXPECT_THAT(damaged.err, HasSubstr("fathom: models/base.safetensors"));
  std::filesystem::remove_all(folder_ / "models");
  EXPECT_THAT(fathom("models").out, HasSubstr("no models in models"));
}

}  // namespace
}  // namespace fathom
