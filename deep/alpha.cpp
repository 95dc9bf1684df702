// Source: Vicini et al., "Denoising Deep Monte Carlo Renderings", equation 8. The sum of the alphas in front that the
// paper subtracts from 1 cancels where a pixel is nearly opaque; the product of what they let through says the same and
// does not.
#include "deep/alpha.h"

#include "base/parallel.h"
#include "deep/volume.h"

namespace fathom::deep {

Buffer<float> effectiveAlpha(const DeepImage& image) {
  const std::span<const float> alpha = image.get("A");
  Buffer<float> result(image.samples());
  const size_t width = size_t(image.dataWindow.width());
  parallelFor(0, image.dataWindow.height(), [&](int y) {
    for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel) {
      double passed = 1;
      for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i) {
        const double a = opacity(alpha[i]);
        result[i] = float(passed * a);
        passed *= 1 - a;
      }
    }
  });
  return result;
}

}  // namespace fathom::deep
