#include "flat/oiio/module.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <memory>
#include <new>

#include "base/error.h"
#include "flat/attribute_text.h"
#include "flat/oiio/attributes.h"

namespace fathom::flat {

namespace {

constexpr int kBandRows = 64;  // a multiple of every EXR compression's block of rows

// OpenImageIO's own words, without the file's name, which every error begins with.
std::string reason(std::string text, const std::string& path = {}) {
  const std::string named = " from image file \"" + path + "\"";
  if (const size_t at = text.find(named); at != text.npos) text.erase(at, named.size());
  return text.empty() ? "no reason given" : oneLine(std::move(text));
}

std::unique_ptr<OIIO::ImageInput> openInput(const std::string& path, bool exr) {
  static const bool onlyByName = OIIO::attribute("try_all_readers", 0);
  (void)onlyByName;
  auto input = OIIO::ImageInput::create(exr ? "openexr" : path);
  OIIO::ImageSpec spec;
  if (!input) fail("{}: expected an image file, found an unknown kind: {}", path, reason(OIIO::geterror()));
  if (!input->open(path, spec))
    fail("{}: expected an image file, found a broken one: {}", path, reason(input->geterror(), path));
  return input;
}

bool isPart(const OIIO::ImageSpec& spec, int number, const std::string& part) {
  return part == std::to_string(number) || part == spec.get_string_attribute("oiio:subimagename");
}

// The number of the part that was asked for.
int findPart(OIIO::ImageInput& input, const std::string& path, const std::string& part) {
  int number = 0;
  for (; input.seek_subimage(number, 0); ++number) {
    const OIIO::ImageSpec spec = input.spec_dimensions(number);
    if (part.empty() ? !spec.deep : isPart(input.spec(number), number, part)) {
      if (spec.deep) fail("{}, part {}: expected a flat image, found a deep one", path, part);
      return number;
    }
  }
  if (part.empty()) fail("{}: expected a flat image, found {} deep part(s) only", path, number);
  fail("{}: expected a part {}, found {} part(s) without it", path, part, number);
}

// Rows [y0, y1) of all channels, interleaved.
void readRows(OIIO::ImageInput& input, int part, const OIIO::ImageSpec& spec, int y0, int y1,
              std::vector<float>& values) {
  values.resize(size_t(y1 - y0) * size_t(spec.width) * size_t(spec.nchannels));
  const bool done = spec.tile_width ? input.read_tiles(part, 0, spec.x, spec.x + spec.width, y0, y1, spec.z, spec.z + 1,
                                                       0, spec.nchannels, OIIO::TypeFloat, values.data())
                                    : input.read_scanlines(part, 0, y0, y1, spec.z, 0, spec.nchannels, OIIO::TypeFloat,
                                                           values.data());
  if (!done) throw Error(input.geterror());
}

// OpenImageIO maps integers to [0,1]; ids are wanted as they are. The scale is 2^32 as a float, and the product exact.
float scaleOf(const OIIO::ImageSpec& spec, int channel) {
  return spec.channelformat(channel) == OIIO::TypeUInt32 ? 4294967295.0f : 1.0f;
}

void separate(const std::vector<float>& interleaved, const OIIO::ImageSpec& spec, size_t firstPixel, size_t pixels,
              Image& image) {
  const size_t stride = size_t(spec.nchannels);
  for (int c = 0; c < spec.nchannels; ++c) {
    float* out = image.planes[size_t(c)].values.data() + firstPixel;
    const float scale = scaleOf(spec, c);
    for (size_t i = 0; i < pixels; ++i) {
      const float value = interleaved[i * stride + size_t(c)];
      out[i] = scale == 1 ? value : value * scale;
    }
  }
}

Image emptyImage(const OIIO::ImageSpec& spec) {
  Image image{{spec.x, spec.y, spec.x + spec.width, spec.y + spec.height},
              {spec.full_x, spec.full_y, spec.full_x + spec.full_width, spec.full_y + spec.full_height},
              {},
              attributesOf(spec)};
  for (const std::string& name : spec.channelnames)
    image.planes.push_back({name, Buffer<float>(image.dataWindow.area())});
  return image;
}

Image readPart(OIIO::ImageInput& input, int part, const OIIO::ImageSpec& spec) {
  Image image = emptyImage(spec);
  std::vector<float> interleaved;
  const int step = spec.tile_height ? spec.tile_height : kBandRows;
  for (int y0 = spec.y; y0 < spec.y + spec.height; y0 += step) {
    const int y1 = std::min(y0 + step, spec.y + spec.height);
    readRows(input, part, spec, y0, y1, interleaved);
    separate(interleaved, spec, size_t(y0 - spec.y) * size_t(spec.width), size_t(y1 - y0) * size_t(spec.width), image);
  }
  return image;
}

// Interleaves rows [y0, y1) of the planes.
void interleave(const Image& image, int y0, int y1, std::vector<float>& values) {
  const size_t width = size_t(image.dataWindow.width()), stride = image.planes.size();
  const size_t first = size_t(y0 - image.dataWindow.y0) * width, pixels = size_t(y1 - y0) * width;
  values.resize(pixels * stride);
  for (size_t c = 0; c < stride; ++c) {
    const float* in = image.planes[c].values.data() + first;
    for (size_t i = 0; i < pixels; ++i) values[i * stride + c] = in[i];
  }
}

void writeBands(OIIO::ImageOutput& output, const OIIO::ImageSpec& spec, const Image& image) {
  std::vector<float> values;
  for (int y0 = spec.y; y0 < spec.y + spec.height; y0 += kBandRows) {
    const int y1 = std::min(y0 + kBandRows, spec.y + spec.height);
    interleave(image, y0, y1, values);
    if (!output.write_scanlines(y0, y1, 0, OIIO::TypeFloat, values.data())) throw Error(output.geterror());
  }
}

// The bytes of `image` as a file of the format `kind`.
std::vector<uint8_t> encode(const char* kind, const OIIO::ImageSpec& spec, const Image& image) {
  OIIO::Filesystem::IOVecOutput bytes;
  const auto output = OIIO::ImageOutput::create(kind, &bytes);
  if (!output) fail("no {} from OpenImageIO: {}", kind, reason(OIIO::geterror()));
  try {
    if (!output->open(kind, spec)) throw Error(output->geterror());
    writeBands(*output, spec, image);
    if (!output->close()) throw Error(output->geterror());
  } catch (const Error& e) {
    throw Error(reason(e.what()));
  }
  return std::move(bytes.buffer());
}

OIIO::ImageSpec specOf(const Image& image) {
  const Box &data = image.dataWindow, &display = image.displayWindow;
  OIIO::ImageSpec spec(data.width(), data.height(), int(image.planes.size()), OIIO::TypeFloat);
  spec.x = data.x0, spec.y = data.y0;
  spec.full_x = display.x0, spec.full_y = display.y0;
  spec.full_width = display.width(), spec.full_height = display.height();
  spec.channelnames.clear();
  for (const Plane& plane : image.planes) spec.channelnames.push_back(plane.name);
  return spec;
}

Image read(const std::string& path, bool exr, const ReadOptions& options) {
  const auto input = openInput(path, exr);
  const int part = findPart(*input, path, options.part);
  const OIIO::ImageSpec spec = input->spec(part);
  const double bytes = double(spec.width) * spec.height * spec.nchannels * double(sizeof(float));
  if (bytes > double(options.memoryLimit))
    fail("{}, part {}: expected at most {:.0f} MB of pixels, found a header that promises {:.0f} MB", path, part,
         double(options.memoryLimit) / 1e6, bytes / 1e6);
  try {
    return readPart(*input, part, spec);
  } catch (const Error& e) {
    fail("{}, part {}: expected {} x {} pixels, found broken data: {}", path, part, spec.width, spec.height,
         reason(e.what(), path));
  } catch (const std::bad_alloc&) {
    fail("{}, part {}: expected {:.0f} MB of memory for its pixels, found less", path, part, bytes / 1e6);
  }
}

std::vector<uint8_t> encodePng(const Image& image) {
  OIIO::ImageSpec spec = specOf(image);
  spec.set_format(OIIO::TypeUInt8);
  return encode("png", spec, image);
}

}  // namespace

}  // namespace fathom::flat

extern "C" __attribute__((visibility("default"))) const fathom::flat::OiioModule* fathomOiioModule() {
  using namespace fathom::flat;
  static const OiioModule module{FATHOM_VERSION, read, encodePng};
  return &module;
}
