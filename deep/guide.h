// Flattened guides: what the pixel weights and the feature gradients of the deep filter are made from.
//
// Source: Vicini et al., sections 4.1 (gradients of the flattened features) and 5.3 (two-buffer variance, blurred, then
// the maximum of both).
#pragma once

#include "deep/denoise_data.h"
#include "deep/joint_filter.h"
#include "flat/image.h"

namespace fathom::deep {

// The flattened blocks of a component and the variance of each, which the blocks share where they are halves.
struct ComponentGuide {
  std::array<Guide, 2> value;
  GuideVariance variance;
};

// `variance`: per bin and channel the variance of the mean of the component, used where there are no halves.
ComponentGuide colourGuide(const DenoiseData& data, const DenoiseComponent& component, int pad);

// Section 5.3: the maximum of a variance and its blurred self, in place; the border (2 at least) is extended. Ours: it
// does not fall below half its mean over 5x5 pixels. The difference of two halves is nearly 0 now and then, and one
// such pixel sets all patches that hold it apart from everything else, which leaves noisy spots of a patch's size. 5 %
// less error.
void prefilterVariance(flat::Padded& variance, int width, int height);

// The flattened mean of a feature (over the pixel's alpha) and its variance, padded; 0 where skip[pixel] != 0.
struct FeatureGuide {
  Guide value;
  GuideVariance variance;
};
FeatureGuide featureGuide(const DenoiseData& data, const Feature& feature, int pad, const Buffer<uint8_t>& skip);

// Per channel of the feature and pixel: the squared magnitude of the gradient of the flattened feature; 0
// where skip[pixel] != 0.
std::vector<Buffer<float>> squaredGradients(const DenoiseData& data, const Feature& feature,
                                            const Buffer<uint8_t>& skip);

}  // namespace fathom::deep
