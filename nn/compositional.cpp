#include "nn/compositional.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>

#include "base/error.h"
#include "base/progress.h"
#include "nn/blocked.h"
#include "nn/colour_kernel.h"
#include "nn/compositional_halo.h"
#include "nn/metadata.h"
#include "nn/tile_work.h"

namespace fathom::nn {

namespace {

constexpr int kColours = 3;
constexpr int kScales = 3;

template <class T>
T* grow(Buffer<T>& buffer, size_t size) {
  if (buffer.size() < size) {
    buffer = {};
    buffer = Buffer<T>(size);
  }
  return buffer.data();
}

void copyRows(const ConstPlanes& from, int height, int width, const Planes& to) {
  for (size_t p = 0; p < from.plane.size(); ++p)
    for (int y = 0; y < height; ++y) std::copy_n(from.row(p, y), width, to.row(p, y));
}

int depthOf(int components) {
  if (components != 1 && components != 2 && components != 4) throw std::logic_error("components are 1, 2 or 4");
  return components / 2;  // how often a colour is split
}

}  // namespace

CompositionalNet::CompositionalNet(const WeightFile& file, Precision precision) : gains_(file) {
  expectMetadata(file, "format", "fathom-compositional");
  expectMetadata(file, "version", "2");
  expectMetadata(file, "inputs", std::to_string(kInputPlanes));
  width_ = widthOf(file);
  WeightSource weights(file);
  EncoderGraph encoder = encoderGraph(weights, width_);
  decomposeValues_ = decomposeGraph(weights, width_);
  denoiseValues_ = denoiseGraph(weights, width_);
  weights.finish();
  planes_ = encoder.planes;
  features_ = encoder.features;
  const Halos halos = halosOf(encoder, decomposeValues_, denoiseValues_, kAlignment);
  levelHalo_ = halos.level;
  encoderHalo_ = halos.encoder;
  const Element element = elementFor(precision);
  encoder_ = std::make_unique<Module>(std::move(encoder.graph), element);
  decompose_ = std::make_unique<Module>(std::move(decomposeValues_.graph), element);
  denoise_ = std::make_unique<Module>(std::move(denoiseValues_.graph), element);
}

double CompositionalNet::flopPerPixel(int components) const {
  const int splits = depthOf(components) ? components - 1 : 0;
  return encoder_->graph().flopPerPixel() + splits * decompose_->graph().flopPerPixel() +
         components * denoise_->graph().flopPerPixel();
}

CompositionalNet::Windows CompositionalNet::windowsFor(const Window& window, int height, int width, int depth) const {
  Windows windows{};
  for (int i = 0; i <= depth; ++i)
    windows.level[size_t(i)] = grown(window, levelHalo_[size_t(depth - i)], height, width);
  windows.encoder = grown(window, encoderHalo_[size_t(depth)], height, width);
  return windows;
}

double CompositionalNet::flop(const Window& window, int height, int width, int components) const {
  const int depth = depthOf(components);
  const Windows windows = windowsFor(window, height, width, depth);
  double sum = encoder_->graph().flopPerPixel() * double(area(windows.encoder));
  for (int i = 0; i < depth; ++i)
    sum += (1 << i) * decompose_->graph().flopPerPixel() * double(area(windows.level[size_t(i)]));
  return sum + components * denoise_->graph().flopPerPixel() * double(area(windows.level[size_t(depth)]));
}

int CompositionalNet::halo(int components) const {
  return encoderHalo_[size_t(depthOf(components))];
}

double CompositionalNet::bytesPerPixel(int components) const {
  constexpr int kSide = 128;
  const int depth = depthOf(components);
  size_t arena = std::max(encoder_->plan(kSide, kSide)->layout().bytes, denoise_->plan(kSide, kSide)->layout().bytes);
  if (depth) arena = std::max(arena, decompose_->plan(kSide, kSide)->layout().bytes);
  const double features = double(bytesOf(element())) * width_;
  const double planes = double(bytesOf(element())) * 32;  // where features of the first level come
  const double colours = kColours * sizeof(float) * (1 + 2 * depth);
  const double logarithms = double(bytesOf(element())) * kColours;
  const double filter = sizeof(float) * (2 * kColours + 1) * (1 + 1.0 / 4 + 1.0 / 16);
  return double(arena) / (kSide * kSide) + std::max(planes, features) + 2 * depth * features + colours + logarithms +
         filter;
}

// One window on its way through the network.
class CompositionalNet::Run {
 public:
  Run(const CompositionalNet& net, const CompositionalInput& frame, const Window& window, int components,
      const Planes& out, Workspace& workspace, const std::stop_token& stop)
      : net_(net), frame_(frame), out_(out), work_(workspace), stop_(stop), depth_(depthOf(components)) {
    window_ = window;
    const Windows windows = net.windowsFor(window, frame.height, frame.width, depth_);
    windows_ = windows.level;
    encoded_ = windows.encoder;
  }

  void run() {
    for (size_t c = 0; c < kColours; ++c)
      for (int y = 0; y < window_.height; ++y) std::fill_n(out_.row(c, window_.y + y) + window_.x, window_.width, 0.0f);
    encode();
    node(0, work_.levels[0][0]);
  }

 private:
  using Level = Workspace::Level;

  size_t pixelBytes() const { return net_.encoder_->sizes().valueBytes * size_t(net_.encoder_->sizes().block); }
  size_t groups() const { return size_t(net_.width_ / net_.encoder_->sizes().block); }
  size_t featureBytes(const Window& window) const { return groups() * pixelBytes() * area(window); }

  const std::byte* runPlan(const Plan& plan, std::initializer_list<const std::byte*> inputs) {
    if (stop_.stop_requested()) throw Cancelled();
    plan.run({inputs.begin(), inputs.size()}, grow(work_.arena, plan.layout().bytes));
    return work_.arena.data();
  }

  // The part `to` of features that were computed for `from`.
  void cropFeatures(const std::byte* features, const Window& from, const Window& to, Level& level) const {
    const Window inside = {to.x - from.x, to.y - from.y, to.width, to.height};
    cropGroups(features, groups(), from.height, from.width, pixelBytes(), inside,
               grow(level.features, featureBytes(to)));
  }

  void cropColour(const ConstPlanes& colour, const Window& to, Level& level) const {
    copyRows(colour, to.height, to.width,
             denseRows(grow(level.colour, kColours * area(to)), kColours, to.height, to.width));
  }

  void encode() {
    const Window& from = encoded_;
    const ElementSizes sizes = net_.encoder_->sizes();
    const size_t bytes = bytesOf(net_.encoder_->graph().info(net_.planes_), sizes, from.height, from.width);
    Level& level = work_.levels[0][0];
    std::byte* planes = grow(level.features, bytes);  // features come where the planes were
    packPlanes(frame_.planes.at(from.x, from.y), from.height, from.width, sizes.block, net_.element(), planes);
    const auto plan = net_.encoder_->plan(from.height, from.width);
    const std::byte* arena = runPlan(*plan, {planes});
    cropFeatures(Plan::result(*plan, arena, net_.features_), from, windows_[0], level);
    cropColour(frame_.colour.at(windows_[0].x, windows_[0].y), windows_[0], level);
  }

  const std::byte* logarithms(const Level& level, const Window& window) {
    const size_t count = kColours * area(window);
    std::byte* to = grow(work_.logColour, count * bytesOf(net_.element()));
    logColour(level.colour.data(), count, net_.element(), to);
    return to;
  }

  void node(int depth, const Level& level) {
    if (depth == depth_) {
      leaf(level);
      return;
    }
    Level* parts = work_.levels[depth + 1];
    split(level, windows_[size_t(depth)], windows_[size_t(depth) + 1], parts);
    node(depth + 1, parts[0]);
    node(depth + 1, parts[1]);
  }

  void split(const Level& level, const Window& from, const Window& to, Level* parts) {
    const DecomposeGraph& values = net_.decomposeValues_;
    const auto plan = net_.decompose_->plan(from.height, from.width);
    const std::byte* arena = runPlan(*plan, {logarithms(level, from), level.features.data()});
    float* colours[2] = {grow(work_.filtered[0], kColours * area(from)),
                         grow(work_.filtered[1], kColours * area(from))};
    splitColour(reinterpret_cast<const float*>(Plan::result(*plan, arena, values.mask)), net_.encoder_->sizes().block,
                level.colour.data(), area(from), colours[0], colours[1]);
    for (int i = 0; i < 2; ++i) {
      const ConstPlanes colour = denseRows<const float>(colours[i], kColours, from.height, from.width);
      cropColour(colour.at(to.x - from.x, to.y - from.y), to, parts[i]);
      cropFeatures(Plan::result(*plan, arena, i ? values.second : values.first), from, to, parts[i]);
    }
  }

  void leaf(const Level& level) {
    const Window& from = windows_[size_t(depth_)];
    const auto plan = net_.denoise_->plan(from.height, from.width);
    const std::byte* arena = runPlan(*plan, {logarithms(level, from), level.features.data()});
    std::array<Planes, kScales> filtered;
    shrinkColours(level, from);
    for (int i = 0; i < kScales; ++i) {
      const int height = from.height >> i, width = from.width >> i;
      const size_t pixels = size_t(height) * size_t(width);
      filtered[size_t(i)] = denseRows(grow(work_.filtered[i], kColours * pixels), kColours, height, width);
      const std::byte* logits = Plan::result(*plan, arena, net_.denoiseValues_.kernel[i]);
      filterColour(reinterpret_cast<const float*>(logits), net_.encoder_->sizes().block, work_.colour[i],
                   filtered[size_t(i)], i < kScales - 1 ? grow(work_.alpha[i], pixels) : nullptr);
    }
    for (int i = kScales - 2; i >= 0; --i)
      addCoarse(filtered[size_t(i)], from.height >> i, from.width >> i, work_.alpha[i].data(), filtered[size_t(i) + 1]);
    addToResult(filtered[0], from);
  }

  void shrinkColours(const Level& level, const Window& window) {
    for (int i = 0; i < kScales; ++i) {
      BorderedColour& colour = work_.colour[i];
      colour.resize(window.height >> i, window.width >> i);
      if (i == 0)
        copyRows(denseRows(level.colour.data(), kColours, window.height, window.width), window.height, window.width,
                 rowsOf(colour));
      else
        halve(constRowsOf(work_.colour[i - 1]), window.height >> (i - 1), window.width >> (i - 1), rowsOf(colour));
      colour.extend();
    }
  }

  static Planes rowsOf(BorderedColour& colour) {
    return {{colour.row(0, 0), colour.row(1, 0), colour.row(2, 0)}, colour.stride()};
  }
  static ConstPlanes constRowsOf(const BorderedColour& colour) {
    return {{colour.row(0, 0), colour.row(1, 0), colour.row(2, 0)}, colour.stride()};
  }

  void addToResult(const Planes& part, const Window& from) const {
    const Planes inside = part.at(window_.x - from.x, window_.y - from.y);
    for (size_t c = 0; c < kColours; ++c)
      for (int y = 0; y < window_.height; ++y) {
        float* to = out_.row(c, window_.y + y) + window_.x;
        const float* row = inside.row(c, y);
        for (int x = 0; x < window_.width; ++x) to[x] += row[x];
      }
  }

  const CompositionalNet& net_;
  const CompositionalInput& frame_;
  const Planes& out_;
  Workspace& work_;
  const std::stop_token& stop_;
  int depth_;
  Window window_, encoded_;
  std::array<Window, 3> windows_;  // where each level's colours and features are known
};

void CompositionalNet::denoise(const CompositionalInput& frame, const Window& window, int components, const Planes& out,
                               Workspace& workspace, const std::stop_token& stop) const {
  for (const int side : {frame.height, frame.width, window.x, window.y, window.width, window.height})
    if (side % kAlignment != 0 || side < 0) throw std::logic_error("sides are multiples of 4");
  if (frame.planes.plane.size() != kInputPlanes || frame.colour.plane.size() != kColours ||
      out.plane.size() != kColours)
    throw std::logic_error("expected 24 planes and 3 colours");
  if (area(window) > 0) Run(*this, frame, window, components, out, workspace, stop).run();
}

}  // namespace fathom::nn
