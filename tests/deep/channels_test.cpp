// What a channel's name says, as docs/channels.md has it.
#include "deep/channels.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/reference/deep_samples.h"

namespace fathom::deep {
namespace {

TEST(Channels, NamesDecideWhatCompositingDoes) {
  const std::pair<Role, std::vector<std::string>> roles[] = {
      {Role::Depth, {"Z", "ZBack"}},
      {Role::Alpha, {"A"}},
      {Role::Plain, {"coc", "time", "lens.u", "lens.v"}},
      {Role::Half, {"half0.R", "half1.R", "half0.albedo.G", "half1.diffuse.B"}},
      {Role::Statistic, {"samples", "half0.samples", "half1.samples", "variance.R", "variance.N.X", "variance.Z"}},
      {Role::Premultiplied, {"R", "albedo.R", "N.X", "diffuse.G", "timed", "lens", "half", "Zeta", "a", "variance"}}};
  for (const auto& [role, names] : roles)
    for (const std::string& name : names) {
      EXPECT_EQ(roleOf(name, PixelType::Float), role) << name;
      EXPECT_EQ(roleOf(name, PixelType::Half), role) << name;
      EXPECT_EQ(roleOf(name, PixelType::Uint), Role::Identifier) << name;
    }
}

TEST(Channels, StatisticsAreToldByAChannelOrTheCount) {
  const auto with = [](const char* name) {
    DeepImage image = reference::makeDeep({{{1, 1, 1, 1, 0}}}, 1);
    if (name) image.add(name, PixelType::Float).values.fill(1);
    return image;
  };
  EXPECT_FALSE(holdsStatistics(with(nullptr)));
  EXPECT_FALSE(holdsStatistics(with("albedo.R")));
  for (const char* name : {"samples", "variance.R", "half0.R", "half1.samples"})
    EXPECT_TRUE(holdsStatistics(with(name))) << name;
  DeepImage counted = with(nullptr);
  counted.attributes.set("fathom:spp", 16);
  EXPECT_TRUE(holdsStatistics(counted));
}

// Colours alone: depths may be infinite, and variances unknown.
TEST(Channels, SamplesThatAreNotFiniteAreCountedOnce) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  DeepImage image =
      reference::makeDeep({{{1, 1, 1, kNan, 0}, {2, 2, 1, 1, 0}}, {}, {{kNan, 1, kNan, 1, 0}, {1, 1, 1, 2e15f, 0}}}, 1);
  image.add("variance.R", PixelType::Float).values.fill(kNan);
  EXPECT_EQ(countNonFinite(image), 2u);
}

}  // namespace
}  // namespace fathom::deep
