// Sources: the comments of OpenEXR's ImfStandardAttributes.h for the matrices (row vectors, NDC from 0 to 1 across the
// display window); files written by V-Ray for `cameraFov` (horizontal: their cameraAperture and cameraFocalLength give
// the same angle). Some renderers write worldToNDC with -1 to 1 across the window, as RenderMan's screen space has it:
// the view axis tells, which stands at 0 there and at a half in the other.
#include "deep/ppu_scale.h"

#include <cmath>
#include <optional>

#include "base/error.h"
#include "deep/camera_matrix.h"

namespace fathom::deep {

namespace {

constexpr double kPi = 3.14159265358979323846;

// Pixels per unit at depth 1, by how far apart two points are seen that lie at that depth.
double scaleOf(const Imath::M44d& worldToCamera, const Imath::M44d& worldToNdc, int width) {
  const Imath::M44d cameraToNdc = worldToCamera.inverse(true) * worldToNdc;
  // At z = 1; cameras that look along -z see that behind them, through the same pinhole and at the same size.
  const auto xAt = [&](double x) { return (Imath::V3d(x, 0, 1) * cameraToNdc).x; };
  const double axis = xAt(0), unit = std::abs(xAt(1) - axis);
  const double windowInNdc = std::abs(axis) < std::abs(axis - 0.5) ? 2 : 1;
  return unit / windowInNdc * width;
}

std::optional<double> scaleFromMatrices(const Attributes& attributes, int width) {
  const auto worldToCamera = matrixOf(attributes, "worldToCamera"), worldToNdc = matrixOf(attributes, "worldToNDC");
  if (!worldToCamera || !worldToNdc) return {};
  try {
    return scaleOf(*worldToCamera, *worldToNdc, width);
  } catch (const std::exception&) {  // a matrix without inverse
    return {};
  }
}

std::optional<double> scaleFromFieldOfView(const Attributes& attributes, int width) {
  for (const char* name : {"fieldOfView", "fieldOfViewHorizontal", "cameraFov"})
    if (const auto degrees = attributes.getFloat(name); degrees && *degrees > 0 && *degrees < 180)
      return width / (2 * std::tan(double(*degrees) * kPi / 360));
  return {};
}

bool usable(std::optional<double> scale) {
  return scale && *scale > 0 && *scale < 1e30;
}

}  // namespace

float findPpuScale(const Attributes& attributes, const Box& displayWindow) {
  if (const auto given = attributes.getFloat("fathom:ppuScale"); usable(given)) return *given;
  if (const auto scale = scaleFromMatrices(attributes, displayWindow.width()); usable(scale)) return float(*scale);
  if (const auto scale = scaleFromFieldOfView(attributes, displayWindow.width()); usable(scale)) return float(*scale);
  fail(
      "depth scale: expected the attribute fathom:ppuScale, worldToCamera with worldToNDC, or a field of view, found "
      "none of "
      "use; give it with --ppu-scale: image width in pixels / (2 tan(half the horizontal field of view))");
}

}  // namespace fathom::deep
