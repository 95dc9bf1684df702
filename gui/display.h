// From scene-linear light to what a screen shows, through OpenColorIO.
#pragma once

#include <QRgb>
#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "gui/view_state.h"

namespace fathom::gui {

// Turns pixels, R, G and B by plane, into opaque ones; from any number of threads at once. Values must be within the
// range of HALF.
using RowTransform = std::function<void(const std::array<const float*, 3>& rgb, int pixels, QRgb* to)>;

class Display {
 public:
  // The config of that file; empty: the one that is built in. Throws Error.
  explicit Display(const std::string& path = {});
  ~Display();

  // The config that the variable OCIO of the environment names, or the one that is built in. Where the named one cannot
  // be used, `problem` says why.
  static std::shared_ptr<const Display> open(std::string& problem);

  const std::string& path() const { return path_; }  // empty: built in
  // What menus offer, the default first.
  std::vector<std::string> displays() const;
  std::vector<std::string> views(const std::string& display) const;
  std::vector<std::string> looks() const;

  // Display, view, look and gamma; the exposure is the caller's. An empty or unknown display or view means the default;
  // an empty look means the view's own. Throws Error where the config's transform cannot be made.
  //
  // A transform that treats each channel by itself is made a table where one is true to it: before they are rounded, its
  // values are less than half a step of 8 bits from those of OpenColorIO. The last ones that were made are kept.
  // `exactly`: never a table.
  RowTransform transform(const DisplayParams& params, bool exactly = false) const;
  // Gamma alone: for what is shown but is no light.
  RowTransform plainTransform(float gamma) const;

 private:
  struct Config;
  std::string path_;
  std::unique_ptr<Config> config_;
};

}  // namespace fathom::gui
