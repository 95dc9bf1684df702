#include "cli/channel_map.h"

#include <gmock/gmock.h>

#include <array>
#include <fstream>
#include <map>

#include "base/error.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::cli {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

std::string errorOf(auto&& call) {
  try {
    call();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

// An image with one sample, whose channels hold the values given.
deep::DeepImage makeSample(const std::vector<std::pair<std::string, float>>& channels) {
  deep::DeepImage image{{0, 0, 1, 1}, {0, 0, 1, 1}, Buffer<uint64_t>(2, 0), {}, {}};
  image.offsets[1] = 1;
  for (const auto& [name, value] : channels) image.add(name, deep::PixelType::Float).values.fill(value);
  return image;
}

std::vector<std::string> namesOf(const deep::DeepImage& image) {
  std::vector<std::string> names;
  for (const deep::Channel& channel : image.channels) names.push_back(channel.name);
  return names;
}

deep::DeepImage mapped(const std::string& map, deep::DeepImage image) {
  const std::vector<std::string> names = namesOf(image);
  const std::vector<MappedChannel> resolved = resolveMap(parseChannelMap("test", map), names);
  applyMap(resolved, image);
  EXPECT_THAT(mappedNames(resolved, names), testing::UnorderedElementsAreArray(namesOf(image)));
  return image;
}

TEST(ChannelMap, LayersAreTakenByTheirEnds) {
  for (const auto& ends : {std::array{"R", "G", "B"}, std::array{"r", "g", "b"}, std::array{"red", "green", "blue"},
                           std::array{"X", "Y", "Z"}, std::array{"x", "y", "z"}}) {
    const auto theirs = [&](size_t i) { return std::string("diffuse_albedo.") + ends[i]; };
    const deep::DeepImage image = mapped("albedo = diffuse_albedo # the colour of the surface\n\nN = diffuse_albedo",
                                         makeSample({{theirs(0), 1.0f}, {theirs(1), 2.0f}, {theirs(2), 3.0f}}));
    EXPECT_THAT(namesOf(image), testing::UnorderedElementsAre("albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z"));
    EXPECT_EQ(image.get("albedo.G")[0], 2.0f);
    EXPECT_EQ(image.get("N.Z")[0], 3.0f);
  }
}

TEST(ChannelMap, SumsLeaveTheirTermsInTheFile) {
  const deep::DeepImage image =
      mapped("specular = RGB - direct - indirect\ndiffuse = direct + indirect", makeSample({{"R", 10.0f},
                                                                                            {"G", 20.0f},
                                                                                            {"B", 30.0f},
                                                                                            {"direct.R", 1.0f},
                                                                                            {"direct.G", 2.0f},
                                                                                            {"direct.B", 3.0f},
                                                                                            {"indirect.R", 0.5f},
                                                                                            {"indirect.G", 0.5f},
                                                                                            {"indirect.B", 0.5f}}));
  EXPECT_EQ(image.get("specular.R")[0], 8.5f);
  EXPECT_EQ(image.get("specular.B")[0], 26.5f);
  EXPECT_EQ(image.get("diffuse.G")[0], 2.5f);
  EXPECT_EQ(image.get("direct.R")[0], 1.0f);
  EXPECT_EQ(image.get("R")[0], 10.0f);
}

TEST(ChannelMap, ErrorsAreOneLine) {
  const auto of = [](const std::string& text) { return errorOf([&] { parseChannelMap("map", text); }); };
  EXPECT_EQ(of("a\vb\r\n"), "channel map map, line 1: expected ours = theirs, found 'a?b?'");
}

TEST(ChannelMap, NamesMayBeExchanged) {
  // What a renderer calls diffuse is the albedo here: no line sees the result of another.
  const deep::DeepImage image = mapped("albedo = diffuse\ndiffuse = lighting", makeSample({{"diffuse.red", 1.0f},
                                                                                           {"diffuse.green", 1.0f},
                                                                                           {"diffuse.blue", 1.0f},
                                                                                           {"lighting.red", 5.0f},
                                                                                           {"lighting.green", 5.0f},
                                                                                           {"lighting.blue", 5.0f}}));
  EXPECT_EQ(image.get("albedo.R")[0], 1.0f);
  EXPECT_EQ(image.get("diffuse.R")[0], 5.0f);
  EXPECT_EQ(image.channels.size(), 6u);
}

TEST(ChannelMap, SingleChannelsAndAlpha) {
  const deep::DeepImage image = mapped(
      "ZBack = Zback\nN = n unpremultiplied\nvariance.Z = depth_variance",
      makeSample(
          {{"Zback", 4.0f}, {"A", 0.25f}, {"n.X", 1.0f}, {"n.Y", 0.0f}, {"n.Z", -1.0f}, {"depth_variance", 2.0f}}));
  EXPECT_EQ(image.get("ZBack")[0], 4.0f);
  EXPECT_EQ(image.get("N.X")[0], 0.25f);
  EXPECT_EQ(image.get("N.Z")[0], -0.25f);
  EXPECT_EQ(image.get("variance.Z")[0], 2.0f);
}

TEST(ChannelMap, IdentifiersKeepTheirNames) {
  deep::DeepImage image = makeSample({{"R", 1.0f}});
  image.add("id", deep::PixelType::Uint).ids[0] = 7;
  EXPECT_EQ(mapped("albedo = nothing", std::move(image)).find("id")->ids[0], 7u);
}

TEST(ChannelMap, WhatTheFileDoesNotHaveIsLeftOut) {
  const std::vector<std::string> names = {"R", "G", "B", "a.R", "a.G", "a.B", "b.R"};
  EXPECT_THAT(resolveMap(parseChannelMap("m", "albedo = x\nZBack = y"), names), IsEmpty());
  EXPECT_THAT(errorOf([&] { resolveMap(parseChannelMap("m", "albedo = a + x"), names); }),
              HasSubstr("channel map m, albedo.R: expected x in the file beside a.R"));
  EXPECT_THAT(errorOf([&] { resolveMap(parseChannelMap("m", "albedo = b"), names); }), HasSubstr("found 1"));
}

TEST(ChannelMap, ErrorsNameTheLine) {
  for (const char* text : {"albedo", "albedo diffuse", "albedo =", "albedo = a b", "albedo = a +", "albedo = a - - b",
                           "albedo = a unpremultiplied b", "= a"})
    EXPECT_THAT(errorOf([&] { parseChannelMap("m", std::string("\n") + text); }), HasSubstr("channel map m, line 2: "))
        << text;
}

TEST(ChannelMap, PresetsLoseNoLight) {
  const std::map<std::string, std::vector<std::string>> documented = {
      {"arnold", {"diffuse.R", "diffuse_albedo.R"}},
      {"karma", {"combineddiffuse.r"}},
      {"renderman", {"diffuse.r", "specular.r", "albedo.r", "normal.x", "mse.r", "diffuse_mse.r"}},
      {"vray", {"diffuse.red", "lighting.red", "gi.red"}}};
  const std::map<std::string, std::array<std::string, 3>> ends = {
      {"R", {"R", "G", "B"}}, {"r", {"r", "g", "b"}}, {"x", {"x", "y", "z"}}, {"red", {"red", "green", "blue"}}};
  for (const std::string& preset : presetNames()) {
    deep::DeepImage image = makeSample({{"R", 9.0f}, {"G", 9.0f}, {"B", 9.0f}, {"A", 1.0f}});
    for (const std::string& first : documented.at(preset)) {
      const size_t dot = first.find('.');
      // In RenderMan's file the two are the whole; elsewhere specular is what diffuse leaves.
      const float value = first == "diffuse.r" ? 4.0f : first == "specular.r" ? 5.0f : 2.0f;
      for (const std::string& end : ends.at(first.substr(dot + 1)))
        image.add(first.substr(0, dot + 1) + end, deep::PixelType::Float).values.fill(value);
    }
    std::vector<std::string> names = namesOf(image);
    applyMap(resolveMap(readChannelMap(preset), names), image);
    for (const char* channel : {"R", "G", "B"})
      EXPECT_EQ(image.get(std::string("diffuse.") + channel)[0] + image.get(std::string("specular.") + channel)[0],
                9.0f)
          << preset;
    EXPECT_EQ(image.find("albedo.B") != nullptr, preset != "karma") << preset;
  }
}

TEST(ChannelMap, FilesAndPresets) {
  const TemporaryFolder folder;
  std::ofstream(folder / "map.txt") << "albedo = base\r\n";
  const ChannelMap map = readChannelMap(folder / "map.txt");
  ASSERT_EQ(map.lines.size(), 1u);
  EXPECT_EQ(map.lines[0].terms[0].theirs, "base");
  EXPECT_THAT(errorOf([&] { readChannelMap(folder / "gone.txt"); }), HasSubstr("gone.txt: expected a file"));
  for (const std::string& name : presetNames()) EXPECT_FALSE(readChannelMap(name).lines.empty()) << name;
}

}  // namespace
}  // namespace fathom::cli
