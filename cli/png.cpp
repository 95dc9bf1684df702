// `fathom png`: one or several images as a PNG, side by side, as a display shows them.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "base/error.h"
#include "cli/commands.h"
#include "cli/load_image.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "flat/io.h"
#include "flat/label.h"
#include "flat/tonemap.h"

namespace fathom::cli {

namespace {

struct PngParams {
  std::vector<std::string> images;
  std::string output;
  double exposure = 0;              // stops
  std::string channels;             // one channel, or what stands before .R .G .B or .X .Y .Z; empty: R G B
  std::vector<float> clip;          // near, far; empty: everything
  std::vector<int> crop;            // x, y, width, height in pixels of the file; empty: the display window
  int zoom = 1;                     // a pixel becomes that many in both directions
  std::vector<std::string> labels;  // one an image, or none
};

constexpr int kGap = 4;
constexpr double kMaxPixels = 1 << 28;  // of the picture: a display window is a promise of the file
constexpr std::array<float, 3> kPaper = {0.12f, 0.12f, 0.12f}, kInk = {0.9f, 0.9f, 0.9f};

flat::Image load(const PngParams& params, const std::string& path) {
  const std::string& wanted = params.channels;
  AnyImage image = loadImage(path, [&](const std::string& channel) {
    if (wanted.empty()) return channel == "R" || channel == "G" || channel == "B";
    return channel == wanted || channel.starts_with(wanted + ".");
  });
  if (auto* flat = std::get_if<flat::Image>(&image)) return std::move(*flat);
  const auto& found = std::get<deep::DeepImage>(image);
  if (params.clip.empty()) return deep::flatten(found);
  return deep::flatten(deep::clip(found, params.clip[0], params.clip[1]));
}

// The channels that become red, green and blue; the same one three times is grey.
std::array<std::string, 3> shownChannels(const flat::Image& image, const std::string& wanted) {
  if (wanted.empty())
    return image.find("Y") && !image.find("R") ? std::array<std::string, 3>{"Y", "Y", "Y"}
                                               : std::array<std::string, 3>{"R", "G", "B"};
  if (image.find(wanted)) return {wanted, wanted, wanted};
  if (image.find(wanted + ".X")) return {wanted + ".X", wanted + ".Y", wanted + ".Z"};
  return {wanted + ".R", wanted + ".G", wanted + ".B"};
}

// How the values of a channel become display values.
enum class Shown { Colour, Opacity, Direction, Range };

Shown shownAs(const std::string& channel, bool alone) {
  if (channel == "A") return Shown::Opacity;
  if (!alone)
    return channel.ends_with(".X") || channel.ends_with(".Y") || channel.ends_with(".Z") ? Shown::Direction
                                                                                         : Shown::Colour;
  const size_t dot = channel.rfind('.');
  const std::string last = dot == channel.npos ? channel : channel.substr(dot + 1);
  return last == "R" || last == "G" || last == "B" || last == "Y" ? Shown::Colour : Shown::Range;
}

// The least and the largest finite value of a channel over all images, in pixels with alpha.
struct Range {
  float low = std::numeric_limits<float>::infinity(), high = -std::numeric_limits<float>::infinity();

  void add(const flat::Plane& plane, const flat::Plane* alpha) {
    for (size_t i = 0; i < plane.values.size(); ++i) {
      if (!std::isfinite(plane.values[i]) || (alpha && !(alpha->values[i] > 0))) continue;
      low = std::min(low, plane.values[i]), high = std::max(high, plane.values[i]);
    }
  }
  float operator()(float value) const { return high > low ? (value - low) / (high - low) : 0; }
};

float displayValue(float value, Shown shown, double gain, const Range& range) {
  switch (shown) {
    case Shown::Opacity:
      return value;
    case Shown::Direction:
      return 0.5f + 0.5f * value;
    case Shown::Range:
      return range(value);
    default:
      return float(flat::srgb(gain * double(value)));
  }
}

Box shownWindow(const PngParams& params, const flat::Image& image) {
  if (params.crop.empty()) return image.displayWindow;
  return {params.crop[0], params.crop[1], params.crop[0] + params.crop[2], params.crop[1] + params.crop[3]};
}

// Where each image goes, and the size of all.
struct Layout {
  std::vector<Box> places;  // in pixels of the picture
  Box picture;
};

Layout layOut(const PngParams& params, const std::vector<flat::Image>& images, int footer) {
  Layout layout;
  double width = 0, height = 0;
  for (const flat::Image& image : images) {
    const Box window = shownWindow(params, image);
    const double left = width > 0 ? width + kGap : 0, right = left + double(window.width()) * params.zoom;
    width = right, height = std::max(height, double(window.height()) * params.zoom);
    if (window.empty() || width * (height + footer) > kMaxPixels)
      fail("{}: expected a picture of 1 to {:.0f} pixels, found {:.0f}", params.output, kMaxPixels,
           width * (height + footer));
    layout.places.push_back({int(left), 0, int(right), window.height() * params.zoom});
  }
  layout.picture = {0, 0, int(width), int(height) + footer};
  return layout;
}

// Draws one image; what is outside its data window is black.
void draw(const PngParams& params, const flat::Image& image, const Range& range, const Box& place,
          flat::Image& picture) {
  const Box window = shownWindow(params, image);
  const auto channels = shownChannels(image, params.channels);
  const double gain = std::exp2(params.exposure);
  for (size_t c = 0; c < 3; ++c) {
    const flat::Plane& plane = image.get(channels[c]);
    const Shown shown = shownAs(channels[c], channels[0] == channels[1]);
    for (int y = place.y0; y < place.y1; ++y)
      for (int x = place.x0; x < place.x1; ++x) {
        const int fromX = window.x0 + (x - place.x0) / params.zoom, fromY = window.y0 + (y - place.y0) / params.zoom;
        const bool inside = image.dataWindow.contains(fromX, fromY);
        picture.planes[c].values[picture.dataWindow.index(x, y)] =
            inside ? displayValue(plane.values[image.dataWindow.index(fromX, fromY)], shown, gain, range) : 0;
      }
  }
}

void runPng(const PngParams& params) {
  if (!params.output.ends_with(".png")) fail("{}: expected a name that ends in .png", params.output);
  if (!params.labels.empty() && params.labels.size() != params.images.size())
    fail("--labels: expected one for each of {} images, found {}", params.images.size(), params.labels.size());
  std::vector<flat::Image> images;
  Range range;
  for (const std::string& path : params.images) {
    images.push_back(load(params, path));
    const auto channels = shownChannels(images.back(), params.channels);
    for (const std::string& channel : channels)
      if (!images.back().find(channel)) fail("{}, channel {}: expected, to be shown, found none", path, channel);
    range.add(images.back().get(channels[0]), images.back().find("A"));
  }
  const int dot = 2, footer = params.labels.empty() ? 0 : flat::labelHeight(dot) + 2 * kGap;
  const Layout layout = layOut(params, images, footer);
  flat::Image picture{layout.picture, layout.picture, {}, {}};
  for (size_t c = 0; c < 3; ++c) picture.add(std::string(1, "RGB"[c]), kPaper[c]);
  for (size_t i = 0; i < images.size(); ++i) {
    const Box& place = layout.places[i];
    draw(params, images[i], range, place, picture);
    if (!params.labels.empty())
      flat::drawLabel(picture, place.x0 + kGap, layout.picture.y1 - footer + kGap, params.labels[i], dot, kInk);
  }
  flat::writePng(params.output, picture);
}

}  // namespace

void addPng(CLI::App& app) {
  auto params = std::make_shared<PngParams>();
  CLI::App* command = app.add_subcommand("png", "Show images as a PNG, side by side");
  command->add_option("images", params->images, "Deep (flattened here) or flat images")->required();
  command->add_option("-o,--output", params->output, "The PNG to write")->required();
  command->add_option("--exposure", params->exposure, "Stops brighter (or darker, below 0)")
      ->check(CLI::Range(-40.0, 40.0));
  command->add_option(
      "--channels", params->channels,
      "What to show instead of R G B: albedo, diffuse, N, A, or one channel such as Z, from its least to its "
      "largest value");
  command->add_option("--clip", params->clip, "NEAR,FAR: of deep images only what lies in between; inf is allowed")
      ->delimiter(',')
      ->expected(2);
  command->add_option("--crop", params->crop, "X,Y,WIDTH,HEIGHT in pixels of the file")->delimiter(',')->expected(4);
  command->add_option("--zoom", params->zoom, "Show each pixel as N x N")->check(CLI::Range(1, 64));
  command->add_option("--labels", params->labels, "A word below each image, such as noisy,denoised")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->footer("Colours are multiplied by 2^exposure and shown with the sRGB curve; above 1 they are white.\n");
  command->callback([params] { runPng(*params); });
}

}  // namespace fathom::cli
