// What is shown and how: all that the picture on the screen depends on beside the images.
#pragma once

#include <string>

#include "deep/clip_view.h"

namespace fathom::gui {

enum class Isolate { All, Red, Green, Blue, Alpha, Luminance };

enum class Comparison { A, B, Wipe, SideBySide, Difference, RelativeError };

struct DisplayParams {
  float exposure = 0;               // stops
  float gamma = 1;                  // after the display transform
  std::string display, view, look;  // names of the OpenColorIO config; empty: its default, and no look
  bool markClipped = false;         // values below 0 and above 1 after exposure
  bool markNan = true;              // values that are no number, or infinite
  float low = 0, high = 0;          // the ends of the false colours; equal: those of the picture
  bool operator==(const DisplayParams&) const = default;
};

struct ViewState {
  std::string layer = "RGBA";
  Isolate isolate = Isolate::All;
  deep::DepthRange clip;
  DisplayParams display;
  Comparison comparison = Comparison::A;
  bool operator==(const ViewState&) const = default;
};

}  // namespace fathom::gui
