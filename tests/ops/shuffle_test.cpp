// Channels that are copied, kept, dropped and filled.
#include "deep/ops/shuffle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "base/error.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;
using ::testing::UnorderedElementsAre;

std::vector<std::string> namesOf(const DeepImage& image) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  return names;
}

bool same(const Channel& a, const Channel& b) {
  if (a.type != b.type || a.size() != b.size()) return false;
  if (a.type == PixelType::Uint) return std::memcmp(a.ids.data(), b.ids.data(), 4 * a.size()) == 0;
  return std::memcmp(a.values.data(), b.values.data(), 4 * a.size()) == 0;
}

DeepImage withLayers() {
  DeepImage image = randomSamples({.seed = 5, .volumes = true, .odd = true});
  for (const char* name : {"diffuse.R", "diffuse.G"}) image.add(name, PixelType::Half).values.fill(0.25f);
  return image;
}

TEST(Shuffle, StarsStandForAnyCharacters) {
  for (const auto& [pattern, name] : {std::pair{"*", "R"},
                                      {"*", ""},
                                      {"Z*", "Z"},
                                      {"Z*", "ZBack"},
                                      {"*.R", "diffuse.R"},
                                      {"diff*.R", "diffuse.R"},
                                      {"R", "R"}})
    EXPECT_TRUE(matches(pattern, name)) << pattern << " " << name;
  for (const auto& [pattern, name] :
       {std::pair{"Z*", "zBack"}, {"*.R", "R"}, {"ab*ba", "aba"}, {"R", "G"}, {"R", "RR"}})
    EXPECT_FALSE(matches(pattern, name)) << pattern << " " << name;
}

TEST(Shuffle, CopiesTakeTheTypeOfTheirSource) {
  const DeepImage image = withLayers();
  const DeepImage result = shuffle(image.copy(), {.map = {{"R", "diffuse.R"}, {"object", "id"}}});
  EXPECT_EQ(result.find("R")->type, PixelType::Half);
  EXPECT_EQ(result.get("R")[0], 0.25f);
  Channel object = std::move(shuffle(image.copy(), {.map = {{"object", "id"}}}).channels.back());
  EXPECT_TRUE(same(object, *image.find("id")));
  EXPECT_TRUE(same(*result.find("G"), *image.find("G")));
}

TEST(Shuffle, ChannelsChangePlaces) {
  const DeepImage image = withLayers();
  const DeepImage result = shuffle(image.copy(), {.map = {{"R", "B"}, {"B", "R"}}});
  EXPECT_TRUE(same(*result.find("R"), *image.find("B")));
  EXPECT_TRUE(same(*result.find("B"), *image.find("R")));
  EXPECT_EQ(result.channels.size(), image.channels.size());
}

TEST(Shuffle, CopiesALayer) {
  const DeepImage image = withLayers();
  const DeepImage result = shuffle(image.copy(), {.map = {{"*", "diffuse.*"}}, .drop = {"diffuse.*", "B"}});
  EXPECT_THAT(namesOf(result), UnorderedElementsAre("R", "G", "A", "Z", "ZBack", "id"));
  EXPECT_EQ(result.find("G")->type, PixelType::Half);
}

TEST(Shuffle, KeepsAndDrops) {
  EXPECT_THAT(namesOf(shuffle(withLayers(), {.keep = {"R", "A", "Z*"}})), UnorderedElementsAre("R", "A", "Z", "ZBack"));
  EXPECT_THAT(namesOf(shuffle(withLayers(), {.keep = {"R", "A", "Z*"}, .drop = {"ZBack", "x*"}})),
              UnorderedElementsAre("R", "A", "Z"));
  EXPECT_EQ(shuffle(withLayers(), {}).channels.size(), withLayers().channels.size());
}

TEST(Shuffle, FillsChannels) {
  const DeepImage result = shuffle(withLayers(), {.set = {{"mask", 0.5}, {"id", 4294967295.0}, {"diffuse.R", 2}}});
  EXPECT_EQ(result.find("mask")->type, PixelType::Float);
  EXPECT_EQ(result.get("mask")[3], 0.5f);
  EXPECT_EQ(result.find("id")->ids[3], 4294967295u);
  EXPECT_EQ(result.find("diffuse.R")->type, PixelType::Half);
}

TEST(Shuffle, RefusesWhatCannotBe) {
  const std::vector<Shuffle> wrong = {{.map = {{"R", "nothing"}}},   {.map = {{"R", "nothing.*"}}},
                                      {.map = {{"*", "nothing.*"}}}, {.map = {{"R", "G"}, {"R", "B"}}},
                                      {.map = {{"Z", "id"}}},        {.keep = {"nothing"}},
                                      {.drop = {"nothing"}},         {.set = {{"id", 0.5}}},
                                      {.set = {{"id", -1}}},         {.set = {{"id", 4294967296.0}}}};
  for (size_t i = 0; i < wrong.size(); ++i) EXPECT_THROW(shuffle(withLayers(), wrong[i]), Error) << i;
}

TEST(Shuffle, OfAnImageWithoutSamples) {
  const DeepImage image = withLayers();
  const DeepImage none = shuffle(rows(image, 3, 3), {.map = {{"*", "diffuse.*"}}, .set = {{"mask", 1}}});
  EXPECT_EQ(none.samples(), 0u);
  EXPECT_EQ(none.channels.size(), image.channels.size() + 1);
}

}  // namespace
}  // namespace fathom::deep
