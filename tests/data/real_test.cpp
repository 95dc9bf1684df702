// Deep files of other programs: read as OpenEXR reads them, written, and read back equal.
#include <gtest/gtest.h>

#include <cctype>
#include <string>

#include "deep/io.h"
#include "deep/statistics.h"
#include "tests/reference/openexr_deep.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::deep {
namespace {

using reference::difference;
using reference::readWithOpenExr;

struct RealFile {
  const char* name;
  size_t samples;
  size_t most;
  uint64_t volumes;
};

class RealFiles : public ::testing::TestWithParam<RealFile> {
 protected:
  std::string path() const { return std::string(FATHOM_SHARED "/real/") + GetParam().name; }
};

// Samples, the most in a pixel and volumes as the description of the files gives them, or as OpenEXR's reader counts.
INSTANTIATE_TEST_SUITE_P(Data, RealFiles,
                         ::testing::Values(RealFile{"representativeDeepImage.exr", 191482, 227, 159121},
                                           RealFile{"deepalpha.exr", 28846, 22, 0},
                                           RealFile{"ids-42.deep.exr", 67605, 8, 0},
                                           RealFile{"Balls.exr", 162877, 2, 0}, RealFile{"Trunks.exr", 49152, 2, 0}),
                         [](const auto& test) {
                           std::string name = test.param.name;
                           std::erase_if(name, [](unsigned char c) { return !std::isalnum(c); });
                           return name;
                         });

TEST_P(RealFiles, ReadAsOpenExrReadsThem) {
  EXPECT_EQ(difference(readWithOpenExr(path()), read(path())), "");
}

TEST_P(RealFiles, HoldWhatTheyAreKnownToHold) {
  Statistics statistics;
  statistics.add(read(path()));
  EXPECT_EQ(statistics.samples, GetParam().samples);
  EXPECT_EQ(statistics.mostSamples, GetParam().most);
  EXPECT_EQ(statistics.volumes, GetParam().volumes);
  EXPECT_EQ(statistics.badDepths, 0u);
}

TEST_P(RealFiles, ComeBackAsTheyWere) {
  TemporaryFolder folder;
  const DeepImage image = read(path());
  for (int tile : {0, 48}) {
    WriteOptions options;
    options.tileWidth = options.tileHeight = tile;
    write(folder / "a.exr", image, options);
    EXPECT_EQ(difference(image, read(folder / "a.exr")), "");
    EXPECT_EQ(difference(image, readWithOpenExr(folder / "a.exr")), "");
  }
}

}  // namespace
}  // namespace fathom::deep
