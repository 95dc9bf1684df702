// Files that once broke a reader, read as flat images: an image or one line, within the memory that was allowed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.h"
#include "flat/io.h"

namespace fathom::flat {
namespace {

TEST(DamagedFlatFiles, EndInAnImageOrInOneLine) {
  size_t files = 0, images = 0;
  for (const auto& entry : std::filesystem::directory_iterator(FATHOM_SHARED "/damaged")) {
    ++files;
    const std::string path = entry.path();
    try {
      const Image image = read(path, {.memoryLimit = size_t(1) << 28});
      EXPECT_LE(image.dataWindow.area() * image.planes.size() * sizeof(float), size_t(1) << 28) << path;
      ++images;
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), ::testing::StartsWith(path));
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << path;
    }
  }
  EXPECT_EQ(files, 92u);
  EXPECT_LT(images, files);
}

}  // namespace
}  // namespace fathom::flat
