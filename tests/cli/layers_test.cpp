// `fathom denoise --method layers` as a user runs it. The weights are random: what is tested is that the network is used as
// it should be, not how well it denoises.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cli/layers_frame.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/oidn/installed.h"
#include "tests/reference/layered.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/noisy_frame.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class LayersDenoise : public testing::Test {
 protected:
  LayersDenoise() {
    std::filesystem::create_directory(folder_ / "models");
    writeModel("models/layers.safetensors", 1);
    deep::write(folder_ / "in.exr", reference::makeNoisyFrame(44, 60, 1));
    deep::write(folder_ / "raw.exr", cameraSamples());
  }

  // Eight samples a pixel, in the convention of files of camera samples.
  static deep::DeepImage cameraSamples() {
    constexpr int kSpp = 8, kWidth = 40, kHeight = 36;
    deep::DeepImage image{{0, 0, kWidth, kHeight}, {0, 0, kWidth, kHeight}, {}, {}, {}};
    image.offsets = Buffer<uint64_t>(image.pixels() + 1);
    for (size_t i = 0; i <= image.pixels(); ++i) image.offsets[i] = i * kSpp;
    const auto fill = [&](const std::string& name, const auto& value) {
      Buffer<float>& values = image.add(name, deep::PixelType::Float).values;
      for (size_t s = 0; s < values.size(); ++s) values[s] = value(s / kSpp, s % kSpp);
    };
    const auto alpha = [](size_t k) { return (1.0f / kSpp) / (1 - float(k) / kSpp); };
    fill("A", [&](size_t, size_t k) { return alpha(k); });
    fill("Z", [](size_t, size_t k) { return k < 3 ? 2 + 0.01f * float(k) : 5 + 0.01f * float(k); });
    for (const char* name : {"R", "G", "B"})
      fill(name, [&](size_t pixel, size_t k) { return alpha(k) * (0.3f + 0.2f * float((pixel * 7 + k * 13) % 5)); });
    image.attributes.set("fathom:spp", kSpp);
    image.attributes.set("fathom:ppuScale", 100.0f);
    return image;
  }

  void writeModel(const std::string& name, unsigned seed) const {
    reference::PlainWeights weights = reference::randomLayered(16, seed);
    weights.metadata["licence"] = "none";
    weights.metadata["steps"] = "12";
    const reference::Bytes bytes = reference::safetensors(weights);
    std::ofstream(folder_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  }
  Ran fathom(const std::string& arguments) const {
    return runFathom(arguments, "cd '" + folder_.path() + "'; FATHOM_MODELS=models");
  }
  Ran run(const std::string& arguments) const { return fathom("denoise --method layers " + arguments); }
  void expectFine(const Ran& outcome) const { ASSERT_EQ(outcome.status, 0) << outcome.err; }
  deep::DeepImage read(const std::string& name) const { return deep::read(folder_ / name); }
  bool exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }

  TemporaryFolder folder_;
};

void expectNear(const flat::Image& a, const flat::Image& b, double bound) {
  for (const char* name : {"R", "G", "B", "A"}) {
    const Buffer<float>&x = a.get(name).values, &y = b.get(name).values;
    ASSERT_EQ(x.size(), y.size());
    for (size_t i = 0; i < x.size(); ++i) ASSERT_NEAR(x[i], y[i], bound) << name << " " << i;
  }
}

TEST_F(LayersDenoise, WritesLayersAndAFlatFrame) {
  for (const std::string in : {"in.exr", "raw.exr"}) {
    expectFine(run(in + " -o layers.exr --as layers --flat both.exr --overwrite --stats stats.json"));
    expectFine(run(in + " -o flat.exr --as flat --overwrite"));
    const deep::DeepImage layers = read("layers.exr");
    size_t most = 0;
    for (size_t i = 0; i < layers.pixels(); ++i) most = std::max(most, layers.count(i));
    EXPECT_EQ(most, 2U);
    EXPECT_EQ(layers.channels.size(), 5U);
    EXPECT_EQ(layers.dataWindow, read(in).dataWindow);
    expectNear(flat::read(folder_ / "flat.exr"), deep::flatten(layers), 1e-6);
    expectNear(flat::read(folder_ / "both.exr"), deep::flatten(layers), 1e-6);
    EXPECT_THAT(textOf(folder_ / "stats.json"), HasSubstr("layer tiles"));
  }
  expectFine(run("in.exr -o four.exr --as layers --layers 4"));
  EXPECT_GT(read("four.exr").samples(), read("layers.exr").samples());
}

// It errs more than what the defaults of a guide are for.
TEST_F(LayersDenoise, BinsFollowItAsANetworkOfOurs) {
  const cli::LayersPlan plan =
      cli::planLayers({.model = folder_ / "models/layers.safetensors"}, {}, deep::Quality::Balanced, size_t(1) << 30);
  EXPECT_EQ(cli::layersGuide(plan, {}, false).denoisers.consistency.mix.prior, deep::kNetworkGuide.mix.prior);
}

// Open Image Denoise is not there, nor a network of flat frames.
TEST_F(LayersDenoise, GuidesFramesOfFewSamplesByItself) {
  const auto guided = [&](const deep::DeepImage& image, const std::string& more = "") {
    deep::write(folder_ / "some.exr", image);
    const Ran outcome = fathom("denoise some.exr -o auto.exr --overwrite " + more);
    expectFine(outcome);
    return outcome.err.find("bins are guided by the layered network, as samples are few") != std::string::npos;
  };
  deep::DeepImage image = read("in.exr");
  image.attributes.set("fathom:spp", 8);
  EXPECT_TRUE(guided(image));
  expectFine(fathom("denoise some.exr -o layers.exr --flat-guide layers"));
  EXPECT_TRUE(std::ranges::equal(read("auto.exr").get("R"), read("layers.exr").get("R")));
  for (const char* more : {"--quality fast", "--error", "--flat-guide none", "--filter paper", "--memory 40M"})
    EXPECT_FALSE(guided(image, more)) << more;
  // Where Open Image Denoise is found, it is taken: this one fails.
  const Ran other = fathom("denoise some.exr -o oidn.exr --oidn-library " + reference::fakeOidn("fake_oidn_failing"));
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(other.err, Not(HasSubstr("layered network")));
  image.attributes.set("fathom:spp", 9);
  EXPECT_FALSE(guided(image));
  expectFine(fathom("denoise some.exr -o none.exr --flat-guide none"));
  EXPECT_TRUE(std::ranges::equal(read("auto.exr").get("R"), read("none.exr").get("R")));
  // Where the file does not say, by its counts.
  image.attributes.erase("fathom:spp");
  EXPECT_FALSE(guided(image));
  for (float& count : image.find("samples")->values) count /= 2;
  EXPECT_TRUE(guided(image));
}

// What the viewer reads of a file, and what other commands make of it.
TEST_F(LayersDenoise, LayersAreAPlainDeepFile) {
  expectFine(run("in.exr -o layers.exr --as layers"));
  const Ran info = fathom("info layers.exr");
  EXPECT_THAT(info.out, AllOf(HasSubstr("FLOAT      A B G R Z"), HasSubstr("2 at most")));
  expectFine(fathom("flatten layers.exr -o flat.exr"));
  expectNear(flat::read(folder_ / "flat.exr"), deep::flatten(read("layers.exr")), 1e-6);
  expectFine(fathom("tidy layers.exr -o tidy.exr"));
  EXPECT_EQ(read("tidy.exr").samples(), read("layers.exr").samples());
}

TEST_F(LayersDenoise, BinsKeepTheirPlaces) {
  const deep::DeepImage in = read("in.exr");
  for (const std::string as : {"bins", "layer-bins"}) {
    expectFine(run(fmt::format("in.exr -o {0}.exr --as {0}", as)));
    const deep::DeepImage out = read(as + ".exr");
    for (const char* name : {"A", "Z"})
      EXPECT_TRUE(std::ranges::equal(out.get(name), in.get(name))) << as << " " << name;
    EXPECT_FALSE(std::ranges::equal(out.get("R"), in.get("R"))) << as;
    EXPECT_TRUE(out.find("id") && out.find("albedo.R"));
    EXPECT_FALSE(out.find("variance.R"));
  }
  EXPECT_TRUE(read("bins.exr").find("diffuse.R"));
  EXPECT_FALSE(read("layer-bins.exr").find("diffuse.R"));
  // The network moves the bins that the deep filter alone would give.
  expectFine(fathom("denoise in.exr -o none.exr --flat-guide none"));
  EXPECT_FALSE(std::ranges::equal(read("bins.exr").get("R"), read("none.exr").get("R")));
  expectFine(fathom("denoise in.exr -o guided.exr --flat-guide layers"));
  EXPECT_TRUE(std::ranges::equal(read("bins.exr").get("R"), read("guided.exr").get("R")));
}

TEST_F(LayersDenoise, CameraSamplesBecomeBins) {
  const Ran outcome = run("raw.exr -o bins.exr");
  expectFine(outcome);
  EXPECT_THAT(outcome.err, HasSubstr("clustered into bins first"));
  EXPECT_LT(read("bins.exr").samples(), read("raw.exr").samples() / 2);
  expectFine(fathom("cluster raw.exr -o clustered.exr"));
  const Ran layers = run("raw.exr -o layers.exr --as layers");
  expectFine(layers);
  EXPECT_THAT(layers.err, HasSubstr("clustered into bins first"));
  expectFine(run("clustered.exr -o expected.exr --as layers"));
  EXPECT_TRUE(std::ranges::equal(read("layers.exr").get("R"), read("expected.exr").get("R")));
}

TEST_F(LayersDenoise, CameraSamplesStayWhereTheyAreToBeColouredOrNothingTellsTheScale) {
  const Ran bins = run("raw.exr -o bins.exr --as layer-bins");
  expectFine(bins);
  EXPECT_THAT(bins.err, Not(HasSubstr("clustered")));
  EXPECT_EQ(read("bins.exr").samples(), read("raw.exr").samples());
  deep::DeepImage image = read("raw.exr");
  image.attributes.erase("fathom:ppuScale");
  deep::write(folder_ / "plain.exr", image);
  const Ran plain = run("plain.exr -o plain-layers.exr --as layers");
  expectFine(plain);
  EXPECT_THAT(plain.err, Not(HasSubstr("clustered")));
  expectFine(run("raw.exr -o layers.exr --as layers"));
  EXPECT_FALSE(std::ranges::equal(read("layers.exr").get("R"), read("plain-layers.exr").get("R")));
}

TEST_F(LayersDenoise, WhereNothingTellsTheNoiseBinsGetTheColoursOfTheirLayers) {
  deep::DeepImage plain = read("in.exr");
  std::erase_if(plain.channels, [](const deep::Channel& channel) { return channel.name.size() > 1; });
  deep::write(folder_ / "plain.exr", plain);
  const Ran outcome = run("plain.exr -o out.exr");
  expectFine(outcome);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("plain.exr: nothing tells its noise: bins get the colours of their layers"),
                    HasSubstr("plain.exr: no albedo.* or N.*"), HasSubstr("all light is taken for one kind")));
  expectFine(run("plain.exr -o other.exr --as layer-bins"));
  EXPECT_TRUE(std::ranges::equal(read("out.exr").get("G"), read("other.exr").get("G")));
}

TEST_F(LayersDenoise, KnowsItsOwnOutputs) {
  const std::string command = "in.exr -o out.exr --as layers";
  expectFine(run(command));
  EXPECT_THAT(run(command).out, HasSubstr("done before"));
  EXPECT_THAT(run(command + " --memory 2G --threads 1 --model models/layers.safetensors").out,
              HasSubstr("done before"));
  for (const char* other :
       {"in.exr -o out.exr --as layers --layers 4", "in.exr -o out.exr --as layer-bins", "in.exr -o out.exr"})
    EXPECT_THAT(run(other).err, HasSubstr("out.exr: expected nothing there")) << other;
  writeModel("models/layers.safetensors", 2);
  EXPECT_THAT(run(command).err, HasSubstr("out.exr: expected nothing there"));
}

TEST_F(LayersDenoise, SequencesGoThroughFrameByFrame) {
  for (int i = 1; i <= 3; ++i)
    deep::write(folder_ / fmt::format("s.{:04}.exr", i), reference::makeNoisyFrame(32, 24, unsigned(i)));
  std::ofstream(folder_ / "s.0002.exr") << "not at all";
  const Ran outcome = run("s.####.exr -o o.####.exr --as layers");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("s.0002.exr"));
  EXPECT_TRUE(exists("o.0001.exr") && exists("o.0003.exr"));
  EXPECT_FALSE(exists("o.0002.exr"));
  deep::write(folder_ / "s.0002.exr", reference::makeNoisyFrame(32, 24, 2));
  const Ran again = run("s.####.exr -o o.####.exr --as layers");
  expectFine(again);
  EXPECT_THAT(again.out, AllOf(HasSubstr("o.0001.exr: done before"), Not(HasSubstr("o.0002.exr: done before"))));
}

TEST_F(LayersDenoise, MemoryAndThreadsDoNotChangeWhatComesOut) {
  deep::write(folder_ / "tall.exr", reference::makeNoisyFrame(200, 500, 1));
  expectFine(run("tall.exr -o a.exr --as layers --memory 8G"));
  expectFine(run("tall.exr -o b.exr --as layers --memory 240M --stats stats.json"));
  expectFine(run("tall.exr -o c.exr --as layers --memory 240M --threads 1"));
  const auto stats = nlohmann::json::parse(textOf(folder_ / "stats.json"));
  EXPECT_GT(stats["frames"][0]["bands"], 1);
  expectNear(deep::flatten(read("a.exr")), deep::flatten(read("b.exr")), 1e-4);
  EXPECT_TRUE(std::ranges::equal(read("b.exr").get("R"), read("c.exr").get("R")));
  const Ran little = run("tall.exr -o d.exr --as layers --memory 20M");
  EXPECT_EQ(little.status, 1);
  EXPECT_THAT(little.err, AllOf(HasSubstr("tall.exr: expected at least"), HasSubstr("MB")));
}

TEST_F(LayersDenoise, WhatDoesNotGoIsOneLine) {
  flat::Image frame = reference::makeNoisyFlat(40, 30, 1).noisy;
  flat::write(folder_ / "flat.exr", frame);
  const auto expectLine = [&](const std::string& arguments, int status, const std::string& text) {
    const Ran outcome = run(arguments + " -o out.exr");
    EXPECT_EQ(outcome.status, status) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr(text)) << arguments;
    EXPECT_FALSE(exists("out.exr"));
  };
  for (const char* as : {"bins", "layers", "flat"})
    expectLine(fmt::format("flat.exr --as {}", as), 1,
               "flat.exr: expected a deep file for --method layers, found a flat one");
  expectLine("in.exr --model base", 1, "--model base: expected base.safetensors in models");
  expectLine("in.exr --layers 3", 2, "--layers");
  expectLine("in.exr --as pixels", 2, "--as");
  expectLine("in.exr --error", 2, "--error");
  expectLine("in.exr --time-budget 5", 2, "--time-budget");
  expectLine("in.exr --as layers --split", 2, "--split");
  expectLine("in.exr --as layers --flat-guide nlm", 2, "--flat-guide");
  expectLine("in.exr --as layer-bins --keep", 2, "--keep");
  EXPECT_EQ(fathom("denoise in.exr -o out.exr --as layers").status, 2);
  deep::DeepImage noDepth = read("in.exr");
  noDepth.erase("B");
  deep::write(folder_ / "none.exr", noDepth);
  expectLine("none.exr --as layers", 1, "none.exr, channel B: expected in a file to denoise, found none");
  const Ran other = run("in.exr -o out.exr --model models/layers.safetensors");
  EXPECT_EQ(other.status, 0) << other.err;
}

TEST_F(LayersDenoise, ModelsAreListed) {
  const Ran outcome = fathom("models");
  expectFine(outcome);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("random"), HasSubstr("12"), HasSubstr("models/layers.safetensors")));
}

}  // namespace
}  // namespace fathom
