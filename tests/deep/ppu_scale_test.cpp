#include "deep/ppu_scale.h"

#include <ImathMatrix.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"

namespace fathom::deep {
namespace {

const Box kWindow{0, 0, 640, 360};

std::array<float, 16> arrayOf(const Imath::M44f& matrix) {
  std::array<float, 16> values;
  std::copy_n(matrix.getValue(), 16, values.begin());
  return values;
}

// A camera somewhere in the world that looks along +z or -z of its space; NDC from 0 to 1 or from -1 to 1. One unit at
// depth 1 is 800 pixels.
Attributes camera(float ahead, bool centred) {
  Imath::M44f worldToCamera;
  worldToCamera.setEulerAngles(Imath::V3f(0.3f, 1.2f, -0.4f));
  worldToCamera[3][0] = 5, worldToCamera[3][1] = -2, worldToCamera[3][2] = 7;
  Imath::M44f projection(0.0f);
  const float scale = 800.0f / 640 * (centred ? 2 : 1);
  projection[0][0] = scale;
  projection[1][1] = -scale * 16 / 9;
  projection[2][0] = projection[2][1] = centred ? 0 : 0.5f * ahead;
  projection[2][2] = ahead * 1.001f;
  projection[2][3] = ahead;
  projection[3][2] = -0.1f;
  Attributes attributes;
  attributes.set("worldToCamera", arrayOf(worldToCamera));
  attributes.set("worldToNDC", arrayOf(worldToCamera * projection));
  return attributes;
}

std::string errorOf(const Attributes& attributes) {
  try {
    findPpuScale(attributes, kWindow);
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(PpuScale, GivenByTheFile) {
  Attributes attributes = camera(1, false);
  attributes.set("fathom:ppuScale", 123.5f);
  EXPECT_EQ(findPpuScale(attributes, kWindow), 123.5f);
}

TEST(PpuScale, FromMatrices) {
  for (const float ahead : {1.0f, -1.0f})
    for (const bool centred : {false, true})
      EXPECT_NEAR(findPpuScale(camera(ahead, centred), kWindow), 800, 0.1) << ahead << centred;
}

TEST(PpuScale, FromTheFieldOfView) {
  Attributes attributes;
  attributes.set("fieldOfView", 90.0f);
  EXPECT_NEAR(findPpuScale(attributes, kWindow), 320, 1e-3);
  Attributes vray;
  vray.set("cameraFov", 26.9862f);  // 24.9294 mm of aperture, 51.9469 mm of focal length
  EXPECT_NEAR(findPpuScale(vray, kWindow), 640 * 51.9469 / 24.9294, 0.01);
}

TEST(PpuScale, WhatIsOfNoUseIsPassedOver) {
  Attributes attributes;
  attributes.set("fathom:ppuScale", -1.0f);
  attributes.set("worldToCamera", std::array<float, 16>{});  // no inverse
  attributes.set("worldToNDC", std::array<float, 16>{});
  attributes.set("fieldOfView", 180.0f);
  EXPECT_THAT(errorOf(attributes), ::testing::HasSubstr("--ppu-scale"));
  attributes.set("cameraFov", 90.0f);
  EXPECT_NEAR(findPpuScale(attributes, kWindow), 320, 1e-3);
  attributes.set("fathom:ppuScale", std::numeric_limits<float>::infinity());
  EXPECT_NEAR(findPpuScale(attributes, kWindow), 320, 1e-3);
}

TEST(PpuScale, SaysHowToGiveIt) {
  EXPECT_THAT(errorOf({}), ::testing::HasSubstr("--ppu-scale"));
}

}  // namespace
}  // namespace fathom::deep
