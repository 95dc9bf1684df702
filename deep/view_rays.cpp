// Source: the comments of OpenEXR's ImfStandardAttributes.h.
#include "deep/view_rays.h"

#include <cmath>

#include "base/error.h"
#include "deep/camera_matrix.h"
#include "deep/ppu_scale.h"

namespace fathom::deep {

namespace {

constexpr double kPi = 3.14159265358979323846;

std::optional<Imath::M44d> inverseOf(const std::optional<Imath::M44d>& matrix) {
  if (!matrix || !(std::abs(matrix->determinant()) > 0)) return {};
  return matrix->inverse();
}

double scaleOf(const Attributes& attributes, const Box& displayWindow, std::optional<float> fieldOfView) {
  if (fieldOfView) return displayWindow.width() / (2 * std::tan(double(*fieldOfView) * kPi / 360));
  try {
    return double(findPpuScale(attributes, displayWindow));
  } catch (const Error&) {
    return 0;
  }
}

// Points in front of the camera have a positive w in NDC.
double forwardOf(const Imath::M44d& cameraToWorld, const std::optional<Imath::M44d>& worldToNdc) {
  if (!worldToNdc) return 1;
  const Imath::M44d cameraToNdc = cameraToWorld * *worldToNdc;
  return cameraToNdc[2][3] < 0 ? -1 : 1;
}

}  // namespace

ViewRays::ViewRays(const Attributes& attributes, const Box& displayWindow, std::optional<float> fieldOfView, Axis axis)
    : scale_(scaleOf(attributes, displayWindow, fieldOfView)),
      middleX_((double(displayWindow.x0) + displayWindow.x1) / 2),
      middleY_((double(displayWindow.y0) + displayWindow.y1) / 2) {
  const auto cameraToWorld = inverseOf(matrixOf(attributes, "worldToCamera"));
  if (!cameraToWorld) return;
  const int column = int(axis);
  placed_ = true;
  start_ = (*cameraToWorld)[3][column];
  right_ = (*cameraToWorld)[0][column];
  up_ = (*cameraToWorld)[1][column];
  forward_ = (*cameraToWorld)[2][column] * forwardOf(*cameraToWorld, matrixOf(attributes, "worldToNDC"));
}

ViewRay ViewRays::at(int x, int y) const {
  const double right = hasScale() ? (x + 0.5 - middleX_) / scale_ : 0;
  const double up = hasScale() ? (middleY_ - (y + 0.5)) / scale_ : 0;
  return {std::sqrt(1 + right * right + up * up), start_, forward_ + right * right_ + up * up_};
}

}  // namespace fathom::deep
