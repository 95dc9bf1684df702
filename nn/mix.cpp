#include "nn/mix.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <mutex>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/blocked.h"

namespace fathom::nn {

namespace {

constexpr int kInputs = 2 * kMixOwn + kMixShared;
constexpr int kWidth = 16;  // of the features at full size
constexpr int kTile = 256;

void expectMetadata(const WeightFile& file, const std::string& key, const std::string& expected) {
  const auto found = file.metadata.find(key);
  if (found == file.metadata.end()) fail("{}: metadata {} is missing", file.name, key);
  if (found->second != expected)
    fail("{}, metadata {}: expected {}, found {}", file.name, key, expected, printable(found->second.substr(0, 60)));
}

struct UNet {
  Graph graph;
  Value planes, features;
};

UNet unetOf(WeightSource& weights) {
  UNet net;
  Graph& graph = net.graph;
  const auto down = [&](const std::string& level, Value from) {
    return graph.conv(weights, "down" + level, from, {.channels = 2 * kWidth, .kernel = 2, .stride = 2});
  };
  const auto up = [&](const std::string& level, Value from, int channels) {
    return graph.upsample(
        graph.conv(weights, "up" + level, from, {.channels = channels, .kernel = 1, .activation = Activation::none}));
  };
  net.planes = graph.input(kInputs);
  const Value x0 = graph.conv(weights, "in", net.planes, {.channels = kWidth, .kernel = 1});
  const Value d0 = down("0", x0);
  const Value x1 = graph.conv(weights, "level1", d0, {.channels = 2 * kWidth, .add = d0});
  const Value d1 = down("1", x1);
  const Value x2 = graph.conv(weights, "level2", d1, {.channels = 2 * kWidth, .add = d1});
  const Value u1 = up("1", x2, 2 * kWidth);
  const Value y1 = graph.conv(weights, "merge1", x1, {.channels = 2 * kWidth, .kernel = 1, .bias = false, .add = u1});
  const Value u0 = up("0", y1, kWidth);
  net.features = graph.conv(weights, "merge0", x0, {.channels = kWidth, .bias = false, .add = u0});
  graph.output(net.features);
  return net;
}

Value logit(Graph& graph, WeightSource& weights, const std::string& name, Value from) {
  const Value value = graph.conv(weights, name, from, {.channels = 1, .kernel = 1, .activation = Activation::none});
  graph.output(value, true);
  return value;
}

struct Head {
  Graph graph;
  Value value;
};

// From a candidate's features and the context.
Head weightHead(WeightSource& weights) {
  Head head;
  const Value own = head.graph.input(kWidth), context = head.graph.input(kWidth);
  const Value term =
      head.graph.conv(weights, "context", context, {.channels = kWidth, .kernel = 1, .activation = Activation::none});
  const Value hidden =
      head.graph.conv(weights, "own", own, {.channels = kWidth, .kernel = 1, .bias = false, .add = term});
  head.value = logit(head.graph, weights, "weight", hidden);
  return head;
}

Head shareHead(WeightSource& weights) {
  Head head;
  const Value context = head.graph.input(kWidth);
  const Value hidden = head.graph.conv(weights, "shareContext", context, {.channels = kWidth, .kernel = 1});
  head.value = logit(head.graph, weights, "share", hidden);
  return head;
}

int rounded(int pixels) {
  return (pixels + MixNet::kAlignment - 1) / MixNet::kAlignment * MixNet::kAlignment;
}

float* grow(Buffer<float>& buffer, size_t size) {
  if (buffer.size() < size) buffer = Buffer<float>(size);
  return buffer.data();
}

const std::byte* bytes(const float* values) {
  return reinterpret_cast<const std::byte*>(values);
}
std::byte* bytes(float* values) {
  return reinterpret_cast<std::byte*>(values);
}

}  // namespace

// What a thread works in.
struct MixNet::Scratch {
  Buffer<float> planes, mean, packed, arena;
  Buffer<float> features;  // of all candidates, and the context behind them

  const float* run(const Module& module, Value value, int height, int width,
                   std::initializer_list<const std::byte*> inputs) {
    const auto plan = module.plan(height, width);
    grow(arena, plan->layout().bytes / sizeof(float) + 1);
    plan->run({inputs.begin(), inputs.size()}, bytes(arena.data()));
    return reinterpret_cast<const float*>(Plan::result(*plan, bytes(std::as_const(arena).data()), value));
  }
};

MixNet::MixNet(const WeightFile& file) {
  expectMetadata(file, "format", "fathom-mix");
  expectMetadata(file, "version", "1");
  WeightSource weights(file);
  UNet net = unetOf(weights);
  Head weight = weightHead(weights), share = shareHead(weights);
  weights.finish();
  features_ = net.features;
  weight_ = weight.value;
  share_ = share.value;
  const Interval needed = net.graph.reach({{features_.index, {0, kAlignment}}})[0];
  halo_ = rounded(std::max(-needed.begin, needed.end - kAlignment));
  unet_ = std::make_unique<Module>(std::move(net.graph));
  head_ = std::make_unique<Module>(std::move(weight.graph));
  shareHead_ = std::make_unique<Module>(std::move(share.graph));
}

double MixNet::flopPerPixel() const {
  return unet_->graph().flopPerPixel() + head_->graph().flopPerPixel() + shareHead_->graph().flopPerPixel();
}

size_t MixNet::bytesPerThread(int candidates) const {
  const int side = kTile + 2 * halo_;
  const size_t planes = kInputs + kMixOwn + kInputs + kWidth * size_t(candidates + 1);
  return planes * sizeof(float) * size_t(side) * size_t(side) + unet_->plan(side, side)->layout().bytes;
}

void MixNet::runTile(const MixSource& source, const Window& tile, Scratch& scratch, MixLogits& result) const {
  const int x0 = std::max(tile.x - halo_, 0), y0 = std::max(tile.y - halo_, 0);
  const int x1 = std::min(tile.x + tile.width + halo_, rounded(source.width)),
            y1 = std::min(tile.y + tile.height + halo_, rounded(source.height));
  const Window from{x0, y0, x1 - x0, y1 - y0};
  const size_t pixels = size_t(from.width) * size_t(from.height);
  const int block = unet_->sizes().block, count = source.candidates;
  const auto planesAt = [&](float* first, int planes) { return denseRows(first, planes, from.height, from.width); };
  float *own = grow(scratch.planes, kInputs * pixels), *apart = own + kMixOwn * pixels,
        *shared = apart + kMixOwn * pixels, *mean = grow(scratch.mean, kMixOwn * pixels);
  source.shared(from, planesAt(shared, kMixShared));
  std::fill_n(mean, kMixOwn * pixels, 0.0f);
  for (int n = 0; n < count; ++n) {
    source.own(n, from, planesAt(own, kMixOwn));
    for (size_t i = 0; i < kMixOwn * pixels; ++i) mean[i] += own[i] / float(count);
  }
  float* features = grow(scratch.features, kWidth * pixels * size_t(count + 1));
  float* context = features + kWidth * pixels * size_t(count);
  std::fill_n(context, kWidth * pixels, 0.0f);
  for (int n = 0; n < count; ++n) {
    source.own(n, from, planesAt(own, kMixOwn));
    for (size_t i = 0; i < kMixOwn * pixels; ++i) apart[i] = own[i] - mean[i];
    float* packed = grow(scratch.packed, kInputs * pixels);
    packPlanes(denseRows<const float>(own, kInputs, from.height, from.width), from.height, from.width, block,
               Element::float32, bytes(packed));
    const float* answer = scratch.run(*unet_, features_, from.height, from.width, {bytes(packed)});
    std::copy_n(answer, kWidth * pixels, features + kWidth * pixels * size_t(n));
    for (size_t i = 0; i < kWidth * pixels; ++i) context[i] += answer[i] / float(count);
  }
  // The first channel of the first group.
  const auto take = [&](const float* answer, Buffer<float>& to) {
    for (int y = tile.y; y < std::min(tile.y + tile.height, source.height); ++y)
      for (int x = tile.x; x < std::min(tile.x + tile.width, source.width); ++x)
        to[size_t(y) * size_t(source.width) + size_t(x)] =
            answer[(size_t(y - from.y) * size_t(from.width) + size_t(x - from.x)) * size_t(block)];
  };
  for (int n = 0; n < count; ++n)
    take(scratch.run(*head_, weight_, from.height, from.width,
                     {bytes(features + kWidth * pixels * size_t(n)), bytes(context)}),
         result.weight[size_t(n)]);
  take(scratch.run(*shareHead_, share_, from.height, from.width, {bytes(context)}), result.share);
}

MixLogits MixNet::run(const MixSource& source, const Progress& progress) const {
  MixLogits result;
  const size_t pixels = size_t(source.height) * size_t(source.width);
  for (int n = 0; n < source.candidates; ++n) result.weight.emplace_back(pixels);
  result.share = Buffer<float>(pixels);
  const int across = (source.width + kTile - 1) / kTile, down = (source.height + kTile - 1) / kTile;
  tbb::enumerable_thread_specific<Scratch> scratches;
  std::mutex guard;
  int done = 0;
  progress.at(0);
  parallelFor(0, across * down, [&](int i) {
    if (progress.stop.stop_requested()) throw Cancelled();
    const int x = i % across * kTile, y = i / across * kTile;
    const Window tile{x, y, std::min(kTile, rounded(source.width) - x), std::min(kTile, rounded(source.height) - y)};
    runTile(source, tile, scratches.local(), result);
    const std::lock_guard lock(guard);
    progress.at(double(++done) / (across * down));
  });
  return result;
}

}  // namespace fathom::nn
