// Which pixels need no denoising: nothing noisy within the filter's window, or nothing at all.
#pragma once

#include "deep/denoise_data.h"
#include "deep/guide.h"

namespace fathom::deep {

// What the tiles of a frame need. Decided per pixel and independent of tiles, so that bands of rows decide alike.
struct Activity {
  // 1: the pixel keeps its colours. It is empty, or the standard deviation of every pixel in the window is below a
  // thousandth of its colour (or of a twentieth of the frame's mean colour, where that is more), which nobody sees. A
  // pixel of which most is in bins of a single camera sample is unknown, and never still; one without colour that no camera
  // sample counts for, as flat frames have where there is nothing, is known.
  Buffer<uint8_t> still;
  // Bit c: component c has light in this pixel.
  Buffer<uint8_t> light;
};

// 1 where a pixel's own noise is not seen (see Activity::still), or there is nothing. `guides`: one per component; none where
// the file has half buffers or variances, which tell more. `level`: the mean colour of the frame.
Buffer<uint8_t> calmPixels(const DenoiseData& data, std::span<const ComponentGuide> guides, const DeepImage& image,
                           const DenoiseInputs& inputs, float level);

// As calmPixels.
Activity findActivity(const DenoiseData& data, std::span<const ComponentGuide> guides, const DeepImage& image,
                      const DenoiseInputs& inputs, int radius, float level);

// 1 where `flags` is not 0 for all pixels within `radius` (a square window that ends at the image's edges).
Buffer<uint8_t> allWithin(const Buffer<uint8_t>& flags, int width, int height, int radius);

// Whether any pixel within `reach` of a tile is not still.
bool activeNear(const DenoiseData& data, const Activity& activity, const Box& tile, int reach);

// The components that a tile needs: bit c where a pixel is not still and component c has light within reach.
unsigned activeComponents(const DenoiseData& data, const Activity& activity, const Box& tile, int radius);

}  // namespace fathom::deep
