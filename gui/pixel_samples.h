// One pixel of a picture, ready for the table and the plot that show it.
#pragma once

#include <QColor>
#include <QPoint>
#include <QString>
#include <optional>
#include <string>
#include <vector>

#include "deep/volume.h"
#include "gui/picture.h"

namespace fathom::gui {

// Samples of a pixel from where on the window would wait for what is found out about them.
inline constexpr size_t kManySamples = 2000;

// How many a pixel of a deep picture has; 0 where there is none.
size_t countAt(const PicturePtr& picture, std::optional<QPoint> pixel);

struct PixelSample {
  deep::Range range;           // as compositing takes it
  double alpha = 0;            // likewise
  double seen = 0, front = 1;  // see deep::SampleLight
  QColor colour;               // of the thing itself, not premultiplied; invalid where there are no colours
};

struct PixelSamples {
  PicturePtr picture;  // null: nothing is shown
  QPoint pixel;
  size_t first = 0;                  // the pixel's first sample; of a flat picture, its place in the planes
  std::vector<PixelSample> samples;  // as stored; one for a pixel of a flat picture
  QString problem;                   // why there is no light: no channel A, too many overlaps; empty: there is

  bool isDeep() const { return picture && picture->deep(); }
  double alpha() const;
};

// The channels that colours are taken from: those of the layer, where it is one of colours, or else R, G and B, or the
// first layer of colours. Empty, or three.
std::vector<std::string> colourChannels(const Picture& picture, const std::string& layer);

// What a display shows for scene-linear light, `stops` brighter.
QColor displayColour(double r, double g, double b, float stops);

// Empty outside of the data window. `stops`: exposure of the colours.
PixelSamples samplesAt(const PicturePtr& picture, QPoint pixel, const std::string& layer, float stops);

}  // namespace fathom::gui
