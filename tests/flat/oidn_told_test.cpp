// What Open Image Denoise is asked, told by a stand-in that answers with it (tests/oidn/fake.cpp).
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "flat/oidn.h"
#include "flat/oidn_library.h"
#include "tests/oidn/installed.h"

namespace fathom::flat {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

using Pixel = std::array<float, 3>;

// Five pixels, each of which is answered with something else; all alike.
Image frame(const Pixel& colour, const std::optional<Pixel>& albedo, const std::optional<Pixel>& normal) {
  Image image{{2, 3, 7, 4}, {0, 0, 9, 9}, {}, {}};
  for (size_t c = 0; c < 3; ++c) {
    image.add(std::string(1, "RGB"[c]), colour[c]);
    if (albedo) image.add(std::string("albedo.") + "RGB"[c], (*albedo)[c]);
    if (normal) image.add(std::string("N.") + "XYZ"[c], (*normal)[c]);
  }
  return image;
}

struct Told {
  Pixel colour, albedo, normal;
  bool hdr, cleanGuides;
  float quality, megabytes, guidesFiltered;
};

Told told(const Image& image, const OidnParams& params = {}) {
  const Image result = oidn(loadOidn(reference::fakeOidn("fake_oidn_telling")), params)(image, {});
  const auto pixel = [&](size_t i) {
    return Pixel{result.get("R").values[i], result.get("G").values[i], result.get("B").values[i]};
  };
  return {pixel(0), pixel(1), pixel(2), pixel(3)[0] != 0, pixel(3)[1] != 0, pixel(4)[0], pixel(4)[1], pixel(4)[2]};
}

constexpr Pixel kColour = {1, 200, 3e6f}, kAlbedo = {0.2f, 0, 1}, kNormal = {-0.6f, 0, 0.8f},
                kNone = {-100, -100, -100};

TEST(Oidn, GuidesThatAreFilteredFirstAreSaidToBeClean) {
  const Told both = told(frame(kColour, kAlbedo, kNormal));
  EXPECT_TRUE(both.hdr && both.cleanGuides);
  EXPECT_EQ(both.guidesFiltered, 2);
  EXPECT_EQ(both.colour, kColour);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(both.albedo[c], kAlbedo[c] + 1);  // as the filter of the albedo alone left it
    EXPECT_EQ(both.normal[c], kNormal[c] + 1);
  }
  const Told one = told(frame(kColour, kAlbedo, {}));
  EXPECT_TRUE(one.hdr && one.cleanGuides);
  EXPECT_EQ(one.guidesFiltered, 1);
  EXPECT_EQ(one.normal, kNone);
}

TEST(Oidn, NoisyGuidesAreNotSaidToBeClean) {
  const Told raw = told(frame(kColour, kAlbedo, kNormal), {.prefilterGuides = false});
  EXPECT_TRUE(raw.hdr);
  EXPECT_FALSE(raw.cleanGuides);
  EXPECT_EQ(raw.guidesFiltered, 0);
  EXPECT_EQ(raw.albedo, kAlbedo);
  EXPECT_EQ(raw.normal, kNormal);
  const Told none = told(frame(kColour, {}, {}));
  EXPECT_FALSE(none.cleanGuides);
  EXPECT_EQ(none.albedo, kNone);
}

TEST(Oidn, NormalsGoWithAnAlbedoOnly) {
  EXPECT_EQ(told(frame(kColour, {}, kNormal)).normal, kNone);
}

TEST(Oidn, WhatIsBeyondItsBoundsEndsThere) {
  const OidnParams raw = {.prefilterGuides = false};
  const Told odd = told(frame({-2, 1e15f, 1e16f}, Pixel{-1, 2, 0.5f}, Pixel{-3, 3, -0.5f}), raw);
  EXPECT_EQ(odd.colour, (Pixel{0, 1e15f, 0}));
  EXPECT_EQ(odd.albedo, (Pixel{0, 1, 0.5f}));
  EXPECT_EQ(odd.normal, (Pixel{-1, 1, -0.5f}));
  const Told none = told(frame({kNaN, kInf, -kInf}, Pixel{kNaN, kInf, 1}, Pixel{kNaN, -kInf, kInf}), raw);
  EXPECT_EQ(none.colour, (Pixel{0, 0, 0}));
  EXPECT_EQ(none.albedo, (Pixel{0, 0, 1}));
  EXPECT_EQ(none.normal, (Pixel{0, 0, 0}));
}

TEST(Oidn, QualityAndMemoryArePassedOn) {
  const Told usual = told(frame(kColour, kAlbedo, kNormal));
  EXPECT_EQ(usual.quality, 6);
  EXPECT_EQ(usual.megabytes, -1) << "asked for, though the library may have as many as it likes";
  const Told other = told(frame(kColour, {}, {}), {.quality = OidnParams::Quality::Fast, .scratchMegabytes = 70});
  EXPECT_EQ(other.quality, 4);
  EXPECT_EQ(other.megabytes, 70);
}

// Only where there is neither colour nor alpha.
TEST(Oidn, OnlyEmptyPixelsStayBlack) {
  for (const auto& [colour, alpha, empty] :
       {std::tuple(0.0f, 0.0f, true), {0.0f, 0.5f, false}, {1.0f, 0.0f, false}, {1.0f, 1.0f, false}}) {
    Image image = frame({colour, colour, colour}, Pixel{0.25f, 0.25f, 0.25f}, {});
    const OidnParams raw = {.prefilterGuides = false};
    EXPECT_EQ(told(image, raw).albedo[0], 0.25f);
    image.add("A", alpha);
    EXPECT_EQ(told(image, raw).albedo[0], empty ? 0 : 0.25f) << colour << ", " << alpha;
  }
}

}  // namespace
}  // namespace fathom::flat
