// What Open Image Denoise reaches on renders through us, against what it reached through its Python package
// (data/baselines.md).
#include <gtest/gtest.h>

#include <string>

#include "flat/io.h"
#include "flat/metrics.h"
#include "flat/oidn.h"
#include "tests/oidn/installed.h"

namespace fathom::flat {
namespace {

struct Baseline {
  const char* name;
  double plain, prefiltered;  // relMSE with guides as they are, and denoised first
};

class WithOidnAccuracy : public reference::WithOidnInstalled, public testing::WithParamInterface<Baseline> {};

// The baselines let light into pixels that hold nothing: up to half a per cent.
TEST_P(WithOidnAccuracy, IsThatOfTheLibrary) {
  const std::string path = FATHOM_SHARED "/renders/" + std::string(GetParam().name);
  const Image noisy = read(path + ".flat.exr"), truth = read(path + ".ref.exr");
  const auto error = [&](const OidnParams& params) {
    return compare(oidn(loadOidn(reference::kOidn), params)(noisy, {}), truth, {.correct = true}).relMse;
  };
  EXPECT_NEAR(error({.prefilterGuides = false}), GetParam().plain, 0.006 * GetParam().plain);
  EXPECT_NEAR(error({}), GetParam().prefiltered, 0.006 * GetParam().prefiltered);
}

INSTANTIATE_TEST_SUITE_P(Renders, WithOidnAccuracy,
                         testing::Values(Baseline{"staircase2", 0.00548, 0.00448}, Baseline{"fur", 0.01650, 0.01907},
                                         Baseline{"coffee", 0.00186, 0.00171}, Baseline{"bathroom2", 0.00287, 0.00249},
                                         Baseline{"staircase", 0.00251, 0.00199},
                                         Baseline{"veach-ajar", 0.00845, 0.00730},
                                         Baseline{"living-room", 0.00875, 0.00721},
                                         Baseline{"kitchen", 0.00651, 0.00604}),
                         [](const auto& test) {
                           std::string name = test.param.name;
                           std::erase(name, '-');
                           return name;
                         });

}  // namespace
}  // namespace fathom::flat
