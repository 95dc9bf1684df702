#include "gui/pixel_samples.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "deep/ops/sample.h"
#include "flat/tonemap.h"

namespace fathom::gui {

namespace {

// One value of each of three channels.
template <class Values>
QColor colourOf(const Values& values, double alpha, float stops) {
  const double scale = alpha > 0 ? 1 / alpha : 1;
  return displayColour(scale * double(values[0]), scale * double(values[1]), scale * double(values[2]), stops);
}

void addLight(const deep::DeepImage& image, PixelSamples& to) {
  try {
    const std::vector<deep::SampleLight> light = deep::lightOf(image, to.pixel.x(), to.pixel.y());
    for (size_t i = 0; i < light.size(); ++i) {
      to.samples[i].seen = light[i].seen;
      to.samples[i].front = light[i].front;
    }
  } catch (const Error& e) {
    to.problem = e.what();
  }
}

void addDeep(const deep::DeepImage& image, const std::vector<std::string>& colour, float stops, PixelSamples& to) {
  const size_t pixel = image.dataWindow.index(to.pixel.x(), to.pixel.y());
  to.first = size_t(image.offsets[pixel]);
  to.samples.resize(image.count(pixel));
  const std::span<const float> alpha = image.tryGet("A"), z = image.tryGet("Z"), zBack = image.tryGet("ZBack");
  for (size_t i = 0; i < to.samples.size(); ++i) {
    PixelSample& sample = to.samples[i];
    const size_t s = to.first + i;
    if (!alpha.empty()) sample.alpha = deep::opacity(alpha[s]);
    if (!z.empty()) sample.range = deep::usableRange(z[s], zBack.empty() ? z[s] : zBack[s]);
    if (!colour.empty())
      sample.colour = colourOf(std::array{image.get(colour[0])[s], image.get(colour[1])[s], image.get(colour[2])[s]},
                               sample.alpha, stops);
  }
  addLight(image, to);
}

void addFlat(const flat::Image& image, const std::vector<std::string>& colour, float stops, PixelSamples& to) {
  to.first = image.dataWindow.index(to.pixel.x(), to.pixel.y());
  PixelSample& sample = to.samples.emplace_back();
  if (const flat::Plane* alpha = image.find("A")) sample.alpha = sample.seen = deep::opacity(alpha->values[to.first]);
  if (!colour.empty())  // what stands in the picture, with its alpha
    sample.colour = colourOf(std::array{image.get(colour[0]).values[to.first], image.get(colour[1]).values[to.first],
                                        image.get(colour[2]).values[to.first]},
                             1, stops);
}

}  // namespace

size_t countAt(const PicturePtr& picture, std::optional<QPoint> pixel) {
  const deep::DeepImage* image = picture ? picture->deep() : nullptr;
  if (!image || !pixel || !image->dataWindow.contains(pixel->x(), pixel->y())) return 0;
  return image->count(image->dataWindow.index(pixel->x(), pixel->y()));
}

double PixelSamples::alpha() const {
  double sum = 0;
  for (const PixelSample& sample : samples) sum += sample.seen;
  return sum;
}

std::vector<std::string> colourChannels(const Picture& picture, const std::string& layer) {
  const auto coloured = [](const Layer* of) {
    return of && of->kind == Layer::Kind::Colour && of->channels.size() > 2;
  };
  const Layer* found = picture.layer(layer);
  if (!coloured(found)) found = picture.layer("RGBA");  // or the first
  for (size_t i = 0; !coloured(found) && i < picture.layers.size(); ++i) found = &picture.layers[i];
  if (!coloured(found)) return {};
  return {found->channels.begin(), found->channels.begin() + 3};
}

QColor displayColour(double r, double g, double b, float stops) {
  const double scale = std::exp2(double(stops));
  return QColor::fromRgbF(float(flat::srgb(scale * r)), float(flat::srgb(scale * g)), float(flat::srgb(scale * b)));
}

PixelSamples samplesAt(const PicturePtr& picture, QPoint pixel, const std::string& layer, float stops) {
  PixelSamples result{picture, pixel, 0, {}, {}};
  if (!picture || !picture->dataWindow().contains(pixel.x(), pixel.y())) return result;
  const std::vector<std::string> colour = colourChannels(*picture, layer);
  if (const deep::DeepImage* image = picture->deep()) addDeep(*image, colour, stops, result);
  if (const flat::Image* image = picture->flat()) addFlat(*image, colour, stops, result);
  return result;
}

}  // namespace fathom::gui
