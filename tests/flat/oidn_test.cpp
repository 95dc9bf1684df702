#include "flat/oidn.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "deep/flatten.h"
#include "flat/oidn_library.h"
#include "tests/oidn/installed.h"
#include "tests/reference/rendered_frame.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::flat {
namespace {

using reference::fakeOidn;
using reference::kOidn;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr std::array<const char*, 3> kRgb{"R", "G", "B"};

// What loading from a place says; it must fail.
std::string loadingError(const std::string& path) {
  try {
    loadOidn(path);
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), Not(HasSubstr("\n")));
    return e.what();
  }
  return "loaded";
}

Image noisyImage(int width, int height) {
  return deep::flatten(reference::renderFrame({.width = width, .height = height}).noisy);
}

bool same(const Image& a, const Image& b) {
  return std::all_of(kRgb.begin(), kRgb.end(), [&](const char* name) {
    const Buffer<float>&x = a.get(name).values, &y = b.get(name).values;
    return std::equal(x.begin(), x.end(), y.begin(), y.end());
  });
}

double squaredError(const Image& image, const Image& truth) {
  double sum = 0;
  for (const char* name : kRgb)
    for (size_t p = 0; p < truth.dataWindow.area(); ++p) {
      const double e = double(image.get(name).values[p]) - double(truth.get(name).values[p]);
      sum += e * e;
    }
  return sum;
}

void erase(Image& image, const std::string& layer) {
  std::erase_if(image.planes, [&](const Plane& plane) { return plane.name.starts_with(layer); });
}

// The environment's library while it lives.
class LibraryVariable {
 public:
  explicit LibraryVariable(const std::string& value) { setenv("FATHOM_OIDN_LIBRARY", value.c_str(), 1); }
  ~LibraryVariable() { unsetenv("FATHOM_OIDN_LIBRARY"); }
  LibraryVariable(const LibraryVariable&) = delete;
  LibraryVariable& operator=(const LibraryVariable&) = delete;
};

TEST(Oidn, AWrongPlaceIsNamed) {
  EXPECT_THAT(loadingError("/nowhere/at/all.so"),
              AllOf(HasSubstr("/nowhere/at/all.so: "), HasSubstr("--oidn-library")));
  const TemporaryFolder folder;
  EXPECT_THAT(loadingError(folder.path()), AllOf(HasSubstr(folder.path()), HasSubstr("libOpenImageDenoise.so.2")));
  const LibraryVariable variable("/nowhere/else");
  EXPECT_THAT(loadingError(""), AllOf(HasSubstr("/nowhere/else: "), HasSubstr("FATHOM_OIDN_LIBRARY")));
  EXPECT_THAT(loadingError("/nowhere/at/all.so"), HasSubstr("/nowhere/at/all.so: "));  // a path comes first
}

TEST(Oidn, NoneOnTheSystemSaysHowToGetIt) {
  const LibraryVariable variable("");
  if (dlopen("libOpenImageDenoise.so.2", RTLD_LAZY) || dlopen("libOpenImageDenoise.so", RTLD_LAZY))
    GTEST_SKIP() << "this system has the library";
  EXPECT_THAT(loadingError(""), AllOf(HasSubstr("libOpenImageDenoise.so.2"), HasSubstr("openimagedenoise.org"),
                                      HasSubstr("--oidn-library"), HasSubstr("FATHOM_OIDN_LIBRARY")));
}

TEST(Oidn, AFileThatIsNoLibraryIsRefused) {
  const TemporaryFolder folder;
  const std::string file = folder / "libOpenImageDenoise.so.2";
  std::ofstream(file) << "text";
  for (const std::string& path : {file, folder.path()})
    EXPECT_THAT(loadingError(path), AllOf(testing::StartsWith(file + ": expected Open Image Denoise 2.3 or newer"),
                                          HasSubstr("file too short")));
}

TEST(Oidn, AnotherLibraryIsRefused) {
  EXPECT_THAT(loadingError(fakeOidn("fake_oidn_empty")), HasSubstr("found a library without oidnNewDevice"));
  EXPECT_THAT(loadingError(fakeOidn("fake_oidn_old")),
              HasSubstr("expected Open Image Denoise 2.3 or newer, found 2.2.9"));
  EXPECT_THAT(loadingError(fakeOidn("fake_oidn_no_device")), testing::EndsWith("this processor is too old"));
}

TEST(Oidn, AnErrorOfTheLibraryIsOneLine) {
  const auto library = loadOidn(fakeOidn("fake_oidn_failing"));
  try {
    oidn(library, {})(noisyImage(8, 8), {});
    ADD_FAILURE() << "expected an error";
  } catch (const Error& e) {
    EXPECT_STREQ(e.what(), "Open Image Denoise 2.3.0: not enough memory");
  }
}

TEST(Oidn, TheSettingsTellWhatDecides) {
  const OidnLibrary a{.file = "a", .version = "2.5.1"}, b{.file = "b", .version = "2.5.0"};
  EXPECT_NE(describeOidn(a, {}), describeOidn(b, {}));
  EXPECT_NE(describeOidn(a, {}), describeOidn(a, {.prefilterGuides = false}));
  EXPECT_NE(describeOidn(a, {}), describeOidn(a, {.quality = OidnParams::Quality::Fast}));
  EXPECT_EQ(describeOidn(a, {}), describeOidn(a, {.scratchMegabytes = 100}));  // which changes no bits
}

class WithOidn : public reference::WithOidnInstalled {
 protected:
  static Image denoised(const Image& noisy, const OidnParams& params = {}, const Progress& progress = {}) {
    return oidn(loadOidn(kOidn), params)(noisy, progress);
  }
};

TEST_F(WithOidn, IsFoundByFileFolderAndEnvironment) {
  const auto library = loadOidn(kOidn);
  EXPECT_EQ(library->version, "2.5.1");
  EXPECT_EQ(loadOidn(kOidn + "/lib")->file, library->file);
  EXPECT_EQ(loadOidn(library->file)->file, library->file);
  const LibraryVariable variable(kOidn);
  EXPECT_EQ(loadOidn()->file, library->file);
}

TEST_F(WithOidn, LeavesLessThanAThirdOfTheError) {
  const reference::RenderedFrame frame = reference::renderFrame({.width = 96, .height = 80, .spp = 8});
  const Image noisy = deep::flatten(frame.noisy), truth = deep::flatten(frame.truth);
  const Image clean = denoised(noisy), raw = denoised(noisy, {.prefilterGuides = false});
  const Image fast = denoised(noisy, {.quality = OidnParams::Quality::Fast, .prefilterGuides = false});
  for (const Image* image : {&clean, &raw, &fast}) {
    EXPECT_EQ(image->dataWindow, noisy.dataWindow);
    EXPECT_EQ(image->planes.size(), 3u);
    EXPECT_LT(squaredError(*image, truth), squaredError(noisy, truth) / 3);
  }
  EXPECT_FALSE(same(clean, raw));
  EXPECT_FALSE(same(raw, fast));
}

TEST_F(WithOidn, NeitherThreadsNorTilesNorRunsShow) {
  const Image noisy = noisyImage(500, 300);
  const OidnParams params{.quality = OidnParams::Quality::Fast, .prefilterGuides = false};
  const Image expected = denoised(noisy, params);
  EXPECT_TRUE(same(denoised(noisy, params), expected));
  OidnParams tiled = params;
  tiled.scratchMegabytes = 1;
  EXPECT_TRUE(same(denoised(noisy, tiled), expected));
  for (const size_t threads : {1, 3}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    EXPECT_TRUE(same(denoised(noisy, params), expected)) << threads;
  }
}

TEST_F(WithOidn, TakesTheGuidesThatAreThere) {
  const Image all = noisyImage(40, 30);
  Image albedo = all.copy(), normal = all.copy(), none = all.copy();
  erase(albedo, "N.");
  erase(normal, "albedo.");
  erase(none, "N.");
  erase(none, "albedo.");
  EXPECT_FALSE(same(denoised(all), denoised(albedo)));
  EXPECT_FALSE(same(denoised(albedo), denoised(none)));
  EXPECT_TRUE(same(denoised(normal), denoised(none)));  // the library takes normals beside an albedo only
  erase(none, "G");
  EXPECT_THROW(denoised(none), Error);
}

TEST_F(WithOidn, TakesTheSmallestImages) {
  for (const auto& [width, height] : {std::pair(1, 1), {3, 2}, {1, 40}}) {
    Image image{{5, 6, 5 + width, 6 + height}, {0, 0, 9, 9}, {}, {}};
    for (const char* name : {"R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z"})
      image.add(name, 0.5f);
    const Image result = denoised(image);
    EXPECT_EQ(result.dataWindow, image.dataWindow);
    for (const char* name : kRgb)
      for (const float value : result.get(name).values) EXPECT_TRUE(value > 0 && value < 1) << width;
  }
  Image empty{{0, 0, 0, 5}, {}, {}, {}};
  for (const char* name : kRgb) empty.add(name);
  EXPECT_TRUE(denoised(empty).get("R").values.empty());
}

TEST_F(WithOidn, OddValuesCountAsNothing) {
  Image odd = noisyImage(40, 30), tame = odd.copy();
  const auto set = [&](const char* name, size_t pixel, float value, float taken) {
    odd.find(name)->values[pixel] = value;
    tame.find(name)->values[pixel] = taken;
  };
  set("R", 400, std::numeric_limits<float>::quiet_NaN(), 0);
  set("G", 500, -std::numeric_limits<float>::infinity(), 0);
  set("B", 510, 1e30f, 0);
  set("R", 600, -3, 0);
  set("albedo.G", 700, std::numeric_limits<float>::quiet_NaN(), 0);
  set("albedo.G", 710, 7, 1);
  set("N.X", 800, -7, -1);
  const Image result = denoised(odd);
  EXPECT_TRUE(same(result, denoised(tame)));
  for (const char* name : kRgb)
    for (const float value : result.get(name).values) ASSERT_TRUE(std::isfinite(value) && value >= 0);
}

TEST_F(WithOidn, EmptyPixelsStayEmpty) {
  const Image noisy = noisyImage(40, 30), clean = denoised(noisy);
  size_t empty = 0;
  for (size_t p = 0; p < noisy.dataWindow.area(); ++p) {
    if (noisy.get("A").values[p] != 0) continue;
    ++empty;
    for (const char* name : kRgb) EXPECT_EQ(clean.get(name).values[p], 0);
  }
  EXPECT_GT(empty, 0u);
}

TEST_F(WithOidn, TellsItsProgressAndStops) {
  const Image noisy = noisyImage(64, 64);
  double last = 0;
  denoised(noisy, {},
           {[&](double done) {
              EXPECT_GE(done, last);
              last = done;
            },
            {}});
  EXPECT_EQ(last, 1);
  for (const double at : {0.0, 0.1, 0.5, 0.9}) {
    std::stop_source stop;
    last = 0;
    const Progress stopping{[&](double done) {
                              last = done;
                              if (done >= at) stop.request_stop();
                            },
                            stop.get_token()};
    EXPECT_THROW(denoised(noisy, {}, stopping), Cancelled) << at;
    EXPECT_LT(last, 1) << at;
  }
  const Progress throwing{[](double done) {
                            if (done > 0.4) fail("enough");
                          },
                          {}};
  EXPECT_THROW(denoised(noisy, {}, throwing), Error);
}

}  // namespace
}  // namespace fathom::flat
