// A frame whose samples take ten times the memory that a chain may use.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "deep/io.h"
#include "flat/io.h"
#include "tests/reference/run_fathom.h"

namespace fathom {
namespace {

constexpr int kWidth = 1024, kHeight = 1024, kSamples = 20, kBandRows = 64;
constexpr uint64_t kMemory = uint64_t(48) << 20;

// Rows [y0, y1) of the frame: a staircase of thin volumes.
deep::DeepImage bandOf(int y0, int y1) {
  deep::DeepImage band{{0, y0, kWidth, y1}, {0, 0, kWidth, kHeight}, {}, {}, {}};
  band.offsets = Buffer<uint64_t>(band.dataWindow.area() + 1);
  for (size_t p = 0; p <= band.dataWindow.area(); ++p) band.offsets[p] = p * kSamples;
  for (const char* name : {"R", "G", "B", "A", "Z", "ZBack"}) {
    deep::Channel& channel = band.add(name, deep::PixelType::Float);
    for (size_t s = 0; s < band.samples(); ++s) {
      const float depth = 1 + float(s % kSamples);
      channel.values[s] = channel.name == "Z" ? depth : channel.name == "ZBack" ? depth + 0.5f : 0.0625f;
    }
  }
  return band;
}

void writeFrame(const std::string& path) {
  deep::Writer writer(path, bandOf(0, 0), {0, 0, kWidth, kHeight});
  for (int y = 0; y < kHeight; y += kBandRows) writer.write(bandOf(y, y + kBandRows));
  writer.finish();
}

uint64_t peakOf(const TemporaryFolder& folder, const std::string& words) {
  const Ran ran = runFathom(words + " --memory 48M --stats stats.json", "cd " + (folder / "") + ";");
  EXPECT_EQ(ran.status, 0) << ran.err;
  return nlohmann::json::parse(textOf(folder / "stats.json"))["peakMemory"];
}

TEST(CompMemory, AFrameOfTenTimesTheMemoryGoesThroughWithinIt) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's own memory counts";
#endif
  ASSERT_GE(uint64_t(kWidth) * kHeight * kSamples * 6 * sizeof(float), 10 * kMemory);
  const TemporaryFolder folder;
  writeFrame(folder / "big.exr");
  EXPECT_LE(peakOf(folder, "comp big.exr --clip 2.25 12 -o clip.exr"), kMemory);
  EXPECT_LE(peakOf(folder, "comp big.exr --clip 2.25 12 --dup --merge -o merge.exr"), kMemory);
  EXPECT_LE(peakOf(folder, "comp big.exr --flatten -o flat.exr"), kMemory);
  EXPECT_EQ(deep::readParts(folder / "clip.exr")[0].dataWindow, (Box{0, 0, kWidth, kHeight}));
  EXPECT_NEAR(flat::read(folder / "flat.exr").get("A").values[0], 1 - std::pow(1 - 0.0625, kSamples), 1e-6);
}

}  // namespace
}  // namespace fathom
