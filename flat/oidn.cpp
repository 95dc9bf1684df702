#include "flat/oidn.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <exception>
#include <memory>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "flat/finite.h"

namespace fathom::flat {

namespace {

constexpr std::array<const char*, 3> kColour = {"R", "G", "B"};
constexpr std::array<const char*, 3> kAlbedo = {"albedo.R", "albedo.G", "albedo.B"};
constexpr std::array<const char*, 3> kNormal = {"N.X", "N.Y", "N.Z"};

// Three planes of an image, interleaved: the layout that the library takes. Values that are not finite become 0, the
// others are clamped.
Buffer<float> pack(const Image& image, const std::array<const char*, 3>& names, float least, float most) {
  const int width = image.dataWindow.width();
  Buffer<float> packed(3 * image.dataWindow.area());
  for (size_t c = 0; c < 3; ++c) {
    const Plane& plane = image.get(names[c]);
    parallelFor(0, image.dataWindow.height(), [&](int y) {
      float* to = packed.data() + 3 * size_t(y) * size_t(width) + c;
      for (const float value : plane.row(width, y)) {
        *to = std::clamp(finiteOrZero(value), least, most);
        to += 3;
      }
    });
  }
  return packed;
}

bool has(const Image& image, const std::array<const char*, 3>& names) {
  return std::all_of(names.begin(), names.end(), [&](const char* name) { return image.find(name); });
}

// The colours as planes. Where there is nothing, the network would let light in from the neighbours.
Image unpack(const Image& noisy, const Buffer<float>& packed) {
  Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  std::array<const float*, 3> before{};
  std::array<float*, 3> after{};
  result.planes.reserve(3);
  for (size_t c = 0; c < 3; ++c) {
    before[c] = noisy.get(kColour[c]).values.data();
    after[c] = result.add(kColour[c]).values.data();
  }
  const Plane* alpha = noisy.find("A");
  parallelFor(0, noisy.dataWindow.height(), [&](int y) {
    const size_t width = size_t(noisy.dataWindow.width());
    for (size_t p = size_t(y) * width; p < size_t(y + 1) * width; ++p) {
      const bool dark = before[0][p] == 0 && before[1][p] == 0 && before[2][p] == 0;
      if (dark && alpha && alpha->values[p] == 0) continue;
      for (size_t c = 0; c < 3; ++c) after[c][p] = packed[3 * p + c];
    }
  });
  return result;
}

// A device of the library with one image size, on which filters run one after the other.
class Session {
 public:
  Session(const OidnLibrary& library, const OidnParams& params, const Box& window, const Progress& progress)
      : library_(library), params_(params), window_(window), progress_(progress) {
    device_ = library.newDevice(OidnLibrary::kCpu);
    if (!device_) check();
    using tbb::global_control;
    library.setDeviceInt(device_, "numThreads",
                         int(global_control::active_value(global_control::max_allowed_parallelism)));
    library.setDeviceBool(device_, "setAffinity", false);  // its threads may be ours
    library.commitDevice(device_);
    check();
  }
  ~Session() {
    if (device_) library_.releaseDevice(device_);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  using Images = std::vector<std::pair<const char*, Buffer<float>*>>;

  // Filters the first of the images in place, which the others guide; its share of the progress is [from, to].
  void filter(const Images& images, bool hdr, bool cleanGuides, double from, double to) {
    struct Release {
      const OidnLibrary& library;
      void operator()(OidnFilter* filter) const { library.releaseFilter(filter); }
    };
    const std::unique_ptr<OidnFilter, Release> filter(library_.newFilter(device_, "RT"), Release{library_});
    if (!filter) check();
    const auto set = [&](const char* name, Buffer<float>& pixels) {
      library_.setSharedFilterImage(filter.get(), name, pixels.data(), OidnLibrary::kFloat3, size_t(window_.width()),
                                    size_t(window_.height()), 0, 0, 0);
    };
    for (const auto& [name, pixels] : images) set(name, *pixels);
    set("output", *images.front().second);
    library_.setFilterBool(filter.get(), "hdr", hdr);
    library_.setFilterBool(filter.get(), "cleanAux", cleanGuides);
    library_.setFilterInt(filter.get(), "quality", int(params_.quality));
    if (params_.scratchMegabytes > 0) library_.setFilterInt(filter.get(), "maxMemoryMB", params_.scratchMegabytes);
    Monitor monitor{progress_, from, to, nullptr};
    library_.setFilterProgressMonitorFunction(filter.get(), Monitor::call, &monitor);
    library_.commitFilter(filter.get());
    check();
    library_.executeFilter(filter.get());
    if (monitor.thrown) std::rethrow_exception(monitor.thrown);
    check();
    progress_.at(to);
  }

 private:
  // Passes the progress on. No exception may cross the library.
  struct Monitor {
    const Progress& progress;
    double from, to;
    std::exception_ptr thrown;

    static bool call(void* user, double done) {
      Monitor& self = *static_cast<Monitor*>(user);
      try {
        self.progress.at(self.from + (self.to - self.from) * std::clamp(done, 0.0, 1.0));
      } catch (...) {
        self.thrown = std::current_exception();
      }
      return !self.thrown;
    }
  };

  void check() const {
    const char* message = nullptr;
    const int error = library_.getDeviceError(device_, &message);
    if (device_ && error == 0) return;
    if (error == OidnLibrary::kCancelledByUser) throw Cancelled();
    fail("Open Image Denoise {}: {}", library_.version, oneLine(message ? message : "no device"));
  }

  const OidnLibrary& library_;
  const OidnParams& params_;
  const Box window_;
  const Progress& progress_;
  OidnDevice* device_ = nullptr;
};

Image run(const OidnLibrary& library, const OidnParams& params, const Image& noisy, const Progress& progress) {
  progress.at(0);
  Buffer<float> colour = pack(noisy, kColour, 0, kLargest), albedo, normal;
  if (colour.empty()) return unpack(noisy, colour);
  if (has(noisy, kAlbedo)) albedo = pack(noisy, kAlbedo, 0, 1);
  if (!albedo.empty() && has(noisy, kNormal)) normal = pack(noisy, kNormal, -1, 1);

  Session session(library, params, noisy.dataWindow, progress);
  Session::Images images = {{"color", &colour}};
  if (!albedo.empty()) images.emplace_back("albedo", &albedo);
  if (!normal.empty()) images.emplace_back("normal", &normal);
  // The three filters take about as long as one another.
  const size_t filters = params.prefilterGuides ? images.size() : 1;
  const auto share = [&](size_t i) { return double(i) / double(filters); };
  for (size_t i = 1; i < filters; ++i) session.filter({images[i]}, false, false, share(i - 1), share(i));
  session.filter(images, true, filters > 1, share(filters - 1), 1);
  return unpack(noisy, colour);
}

}  // namespace

std::string describeOidn(const OidnLibrary& library, const OidnParams& params) {
  return fmt::format("oidn {} quality {} prefilter {}", library.version, int(params.quality), params.prefilterGuides);
}

Denoiser oidn(std::shared_ptr<const OidnLibrary> library, const OidnParams& params) {
  return [library = std::move(library), params](const Image& noisy, const Progress& progress) {
    return run(*library, params, noisy, progress);
  };
}

}  // namespace fathom::flat
