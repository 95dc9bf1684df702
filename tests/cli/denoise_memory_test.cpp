// A frame of camera samples that take more memory than a run may use.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "deep/io.h"
#include "tests/reference/run_fathom.h"

namespace fathom {
namespace {

constexpr int kWidth = 128, kHeight = 1024, kSamples = 80, kBandRows = 64;
constexpr uint64_t kMemory = uint64_t(180) << 20;

// Rows [y0, y1) of the frame: two surfaces, in every fourth pixel the nearer one alone, with grain.
deep::DeepImage bandOf(int y0, int y1) {
  deep::DeepImage band{{0, y0, kWidth, y1}, {0, 0, kWidth, kHeight}, {}, {}, {}};
  band.attributes.set("fathom:spp", kSamples);
  band.attributes.set("fathom:ppuScale", float(kWidth));
  band.offsets = Buffer<uint64_t>(band.dataWindow.area() + 1);
  for (size_t p = 0; p <= band.dataWindow.area(); ++p) band.offsets[p] = p * kSamples;
  for (const char* name : {"R", "G", "B", "A", "Z"}) {
    deep::Channel& channel = band.add(name, deep::PixelType::Float);
    for (size_t s = 0; s < band.samples(); ++s) {
      const size_t pixel = s / kSamples, k = s % kSamples;
      const bool near = pixel % 4 == 0 || k < kSamples / 2;
      const float alpha = 1.0f / float(kSamples - k), depth = near ? 4 : 9;
      channel.values[s] = *name == 'A'   ? alpha
                          : *name == 'Z' ? depth + float(k) * 1e-5f
                                         : alpha * float(s * 7 % 11) / 8;
    }
  }
  return band;
}

TEST(DenoiseMemory, CameraSamplesOfMoreThanTheMemoryGoThroughWithinIt) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's own memory counts";
#endif
  ASSERT_GT(uint64_t(kWidth) * kHeight * kSamples * 5 * sizeof(float), kMemory);
  const TemporaryFolder folder;
  {
    deep::Writer writer(folder / "big.exr", bandOf(0, 0), {0, 0, kWidth, kHeight});
    for (int y = 0; y < kHeight; y += kBandRows) writer.write(bandOf(y, y + kBandRows));
    writer.finish();
  }
  const auto denoise = [&](const std::string& memory) {
    const Ran ran =
        runFathom("denoise big.exr --quality fast -o " + memory + ".exr --stats stats.json --memory " + memory,
                  "cd " + (folder / "") + ";");
    EXPECT_EQ(ran.status, 0) << ran.err;
    return uint64_t(nlohmann::json::parse(textOf(folder / "stats.json"))["peakMemory"]);
  };
  EXPECT_LE(denoise("180M"), kMemory);
  denoise("8G");
  EXPECT_TRUE(textOf(folder / "180M.exr") == textOf(folder / "8G.exr"));
}

}  // namespace
}  // namespace fathom
