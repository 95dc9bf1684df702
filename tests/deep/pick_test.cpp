// What is picked is what was there.
#include "deep/pick.h"

#include <gtest/gtest.h>

#include "deep/clip_view.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

TEST(Pick, SamplesStayWithTheirPixels) {
  const DeepImage image = randomSamples({.window = {-3, 2, 14, 13}, .seed = 5, .volumes = true});
  for (const int step : {1, 3}) {
    const Box box{-5, 0, 12, 16};
    const DeepImage part = pick(image, box, step, {"A", "Z", "nothing"});
    ASSERT_EQ(part.channels.size(), 2u);
    for (int y = 0; y < part.dataWindow.y1; ++y)
      for (int x = 0; x < part.dataWindow.x1; ++x) {
        const int fromX = box.x0 + x * step, fromY = box.y0 + y * step;
        const size_t pixel = part.dataWindow.index(x, y);
        if (!image.dataWindow.contains(fromX, fromY)) {
          EXPECT_EQ(part.count(pixel), 0u);
          continue;
        }
        const size_t from = image.dataWindow.index(fromX, fromY);
        ASSERT_EQ(part.count(pixel), image.count(from));
        for (const char* name : {"A", "Z"})
          EXPECT_TRUE(std::ranges::equal(part.get(name).subspan(part.offsets[pixel], part.count(pixel)),
                                         image.get(name).subspan(image.offsets[from], image.count(from))));
      }
  }
}

TEST(Pick, LooksAsTheImageDoes) {
  const DeepImage image = randomSamples({.seed = 6, .volumes = true});
  const DeepImage part = pick(image, image.dataWindow, 2, {"R", "A", "Z", "ZBack"});
  const flat::Image there = clipView(image, image.dataWindow, 2, {}, {"R"}),
                    here = clipView(part, part.dataWindow, 1, {}, {"R"});
  EXPECT_TRUE(std::ranges::equal(there.get("R").values, here.get("R").values));
}

}  // namespace
}  // namespace fathom::deep
