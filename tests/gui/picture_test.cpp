// Layers to choose from, as a file's channels make them.
#include "gui/picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fathom::gui {
namespace {

using ::testing::ElementsAre;

deep::DeepImage withChannels(const std::vector<std::string>& floats, const std::vector<std::string>& ids = {}) {
  const Box window{0, 0, 1, 1};
  deep::DeepImage image{window, window, Buffer<uint64_t>(2, 0), {}, {}};
  for (const std::string& name : floats) image.add(name, deep::PixelType::Float);
  for (const std::string& name : ids) image.add(name, deep::PixelType::Uint);
  return image;
}

const Layer& find(const std::vector<Layer>& layers, const std::string& name) {
  const auto found = std::ranges::find(layers, name, &Layer::name);
  if (found == layers.end()) fail("no layer {}", name);
  return *found;
}

TEST(Picture, ChannelsBecomeLayers) {
  const auto layers =
      layersOf(withChannels({"A", "B", "G", "R", "Z", "ZBack", "N.X", "N.Y", "N.Z", "diffuse.B", "diffuse.G",
                             "diffuse.R", "variance.B", "variance.G", "variance.R", "samples"},
                            {"id"}));
  EXPECT_EQ(layers[0].name, "RGBA");
  EXPECT_THAT(layers[0].channels, ElementsAre("R", "G", "B", "A"));
  EXPECT_EQ(find(layers, "N").kind, Layer::Kind::Vector);
  EXPECT_THAT(find(layers, "N").channels, ElementsAre("N.X", "N.Y", "N.Z"));
  EXPECT_EQ(find(layers, "diffuse").kind, Layer::Kind::Colour);
  EXPECT_EQ(find(layers, "variance").kind, Layer::Kind::Variance);
  EXPECT_EQ(find(layers, "Z").kind, Layer::Kind::Depth);
  EXPECT_EQ(find(layers, "samples").kind, Layer::Kind::Scalar);
  EXPECT_EQ(find(layers, "id").kind, Layer::Kind::Identifier);
  EXPECT_EQ(layers.back().kind, Layer::Kind::Count);
}

TEST(Picture, AYAloneIsGreyAndTheFirst) {
  const auto layers = layersOf(withChannels({"A", "Y", "Z", "mask.Y", "motion.X", "motion.Y", "variance.Y"}));
  EXPECT_EQ(layers[0].name, "Y");
  EXPECT_EQ(layers[0].kind, Layer::Kind::Colour);
  EXPECT_EQ(find(layers, "mask.Y").kind, Layer::Kind::Colour);
  EXPECT_EQ(find(layers, "motion.Y").kind, Layer::Kind::Scalar);
  EXPECT_EQ(find(layers, "variance.Y").kind, Layer::Kind::Variance);
}

TEST(Picture, ALayerThatIsNotThereIsTheFirst) {
  const PicturePtr picture = makePicture("a.exr", withChannels({"A", "B", "G", "R", "Z"}));
  EXPECT_EQ(picture->layer("nothing")->name, "RGBA");
  EXPECT_EQ(picture->layer("Z")->name, "Z");
}

TEST(Picture, LoadsDeepAndFlat) {
  const PicturePtr deep = loadPicture(FATHOM_DEMO "/smoke.0001.deep.exr");
  ASSERT_NE(deep->deep(), nullptr);
  EXPECT_GT(deep->bytes(), deep->deep()->samples() * deep->deep()->channels.size() * sizeof(float));
  const PicturePtr flat = loadPicture(FATHOM_DEMO "/sequence.0001.ref.exr");
  ASSERT_NE(flat->flat(), nullptr);
  EXPECT_EQ(flat->layer("RGBA")->kind, Layer::Kind::Colour);
  EXPECT_THROW(loadPicture(FATHOM_DEMO "/nothing.exr"), Error);
}

}  // namespace
}  // namespace fathom::gui
