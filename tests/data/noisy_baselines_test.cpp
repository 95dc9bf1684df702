// The errors of the noisy frames, as an independent implementation measured them (data/baselines.md, columns "noisy"):
// whoever changes what `compare` measures changes what every other figure means.
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "deep/compare.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"

namespace fathom::deep {
namespace {

struct Noisy {
  const char* name;
  double flattened, bins, front, behind;
};

class NoisyBaselines : public ::testing::TestWithParam<Noisy> {};

std::string pathOf(const std::string& name) {
  return FATHOM_SHARED "/renders/" + name;
}

TEST_P(NoisyBaselines, AreReproduced) {
  const Noisy expected = GetParam();
  const std::string name = expected.name;
  const DeepImage image = read(pathOf(name + ".deep.exr")), reference = read(pathOf(name + ".deepref.exr"));
  const flat::Image flatReference = flat::read(pathOf(name + ".ref.exr"));

  const flat::Metrics flattened = flat::compare(flatten(image), flatReference, {.correct = true});
  const float median = medianDepth(reference);
  const DeepMetrics bins = compare(image, reference, {.clips = {median}});
  const double tolerance = 0.002;
  EXPECT_NEAR(flattened.relMse, expected.flattened, tolerance * expected.flattened);
  EXPECT_NEAR(bins.bins.relMse, expected.bins, tolerance * expected.bins);
  EXPECT_NEAR(bins.clips[0].front->relMse, expected.front, tolerance * expected.front);
  EXPECT_NEAR(bins.clips[0].behind->relMse, expected.behind, tolerance * expected.behind);
  EXPECT_LT(bins.bins.leftOut, 0.002);
}

INSTANTIATE_TEST_SUITE_P(Renders, NoisyBaselines,
                         ::testing::Values(Noisy{"staircase2", 0.10579, 0.19561, 0.13566, 0.08169},
                                           Noisy{"fur", 0.01985, 0.05017, 0.03215, 0.01040},
                                           Noisy{"coffee", 0.02659, 0.03449, 0.04517, 0.00695},
                                           Noisy{"bathroom2", 0.03396, 0.05537, 0.03740, 0.03476},
                                           Noisy{"staircase", 0.01433, 0.02160, 0.01307, 0.01584},
                                           Noisy{"veach-ajar", 0.32196, 0.44446, 0.45735, 0.22247},
                                           Noisy{"living-room", 0.07526, 0.12212, 0.07584, 0.08436},
                                           Noisy{"kitchen", 0.08365, 0.11717, 0.07460, 0.09966}),
                         [](const auto& test) {
                           std::string name = test.param.name;
                           std::erase(name, '-');
                           return name;
                         });

}  // namespace
}  // namespace fathom::deep
