#include "deep/layers.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"

namespace fathom::deep {

namespace {

constexpr int kStep = nn::LayersNet::kAlignment;
constexpr int kTiles[] = {512, 384, 256, 128, 64};
// Bytes of rows that are read at once, where one row is not more.
constexpr size_t kLeastPiece = size_t(1) << 20, kMostPiece = size_t(128) << 20;
constexpr double kRowBytes = 6 * sizeof(float);  // of a pixel in LayeredRows, beside the band
constexpr double kTogether = 4;                  // tiles that should fit at once, before they become smaller

int rounded(int side) {
  return (side + kStep - 1) / kStep * kStep;
}

double tileBytes(const nn::LayersNet& net, int tile) {
  const double side = tile + 2.0 * std::max(net.contextHalo(), net.filterHalo());
  return net.tileBytes() * side * side;
}

size_t pieceBytes(const LayersParams& params) {
  return params.memory ? std::clamp(params.memory / 8, kLeastPiece, kMostPiece) : kMostPiece;
}

// How a frame is cut for a given memory.
struct Cut {
  int rows = 0;  // of a band
  int tile = kTiles[0];
  int threads = 1;  // that work on tiles at once
};

double bandBytes(const nn::LayersNet& net, int layers, int lights, const Box& window, int rows) {
  const double held = std::min(rows + 2 * net.halo(), rounded(window.height()));
  return rounded(window.width()) * (held * net.bandBytes(layers, lights) + rows * kRowBytes);
}

Cut cutFor(const nn::LayersNet& net, const LayersParams& params, int lights, const Box& window) {
  const int height = rounded(window.height()), most = tbb::this_task_arena::max_concurrency();
  if (params.memory == 0) return {height, kTiles[0], most};
  const double memory = double(params.memory - std::min(params.memory, pieceBytes(params)));
  Cut cut;
  for (const int tile : kTiles) {
    cut.tile = tile;
    if (kTogether * tileBytes(net, tile) <= memory / 2) break;
  }
  // As many rows as leave room for one tile, then as many tiles as fit beside them.
  const double left = memory - tileBytes(net, cut.tile);
  for (cut.rows = height; cut.rows > kStep && bandBytes(net, params.layers, lights, window, cut.rows) > left;)
    cut.rows = rounded(cut.rows / 2);
  const double rest = memory - bandBytes(net, params.layers, lights, window, cut.rows);
  cut.threads = std::clamp(int(rest / tileBytes(net, cut.tile)), 1, most);
  return cut;
}

// Calls take(image) for pieces of rows, one after the other.
template <class Take>
void forPieces(const LayerSource& source, int y0, int y1, size_t most, const Progress& progress, const Take& take) {
  for (int y = y0; y < y1;) {
    progress.at(double(y - y0) / (y1 - y0));
    int end = y + 1;
    size_t bytes = source.bytes(y, end);
    while (end < y1 && (bytes += source.bytes(end, end + 1)) <= most) ++end;
    take(source.read(y, end));
    y = end;
  }
  progress.at(1);
}

Progress part(const Progress& progress, double from, double to) {
  return {[&progress, from, to](double done) { progress.at(from + done * (to - from)); }, progress.stop};
}

// One band: rows [y0, y1), which count from the first of the data window.
class BandRun {
 public:
  BandRun(const nn::LayersNet& net, const LayersParams& params, int tile, const LayerSource& source,
          const LayerScale& scale, int y0, int y1)
      : source_(source),
        scale_(scale),
        piece_(pieceBytes(params)),
        y0_(y0),
        y1_(y1),
        band_(net, rounded(source.dataWindow.height()), rounded(source.dataWindow.width()),
              {y0 / kStep * kStep, rounded(y1)}, params.layers, scale.lights, tile),
        result_{band_,
                scale,
                source.dataWindow,
                source.displayWindow,
                source.dataWindow.y0 + y0,
                source.dataWindow.y0 + y1,
                {},
                {},
                {},
                {}} {
    const size_t pixels = size_t(y1 - y0) * size_t(source.dataWindow.width());
    result_.emission = Buffer<float>(3 * pixels, 0.0f);
    result_.emissionDepth = Buffer<float>(pixels, 0.0f);
    result_.render = Buffer<float>(pixels, 0.0f);
  }

  LayeredRows& run(const Progress& progress) {
    forRows(band_.meanRows(), part(progress, 0, 0.3), [&](int y, const LayerRow& row) {
      band_.addMeans(y, row.samples);
      keep(row, y);
    });
    band_.makeContext(part(progress, 0.3, 0.55));
    forRows(band_.sumRows(), part(progress, 0.55, 0.9),
            [&](int y, const LayerRow& row) { band_.addSums(y, row.samples); });
    band_.filter(part(progress, 0.9, 1));
    return result_;
  }

  uint64_t nonFinite() const { return nonFinite_; }

 private:
  // Calls take(y, row) for the rows that there are, many at once.
  template <class Take>
  void forRows(const nn::Interval& rows, const Progress& progress, const Take& take) {
    const int top = source_.dataWindow.y0, end = std::min(rows.end, source_.dataWindow.height());
    forPieces(source_, top + rows.begin, top + end, piece_, progress, [&](const DeepImage& image) {
      parallelFor(image.dataWindow.y0, image.dataWindow.y1,
                  [&](int y) { take(y - top, layerRow(image, source_.inputs, scale_, y)); });
    });
  }

  void keep(const LayerRow& row, int y) {
    if (y < y0_ || y >= y1_) return;
    const auto width = size_t(source_.dataWindow.width());
    const size_t plane = size_t(y1_ - y0_) * width, first = size_t(y - y0_) * width;
    for (size_t c = 0; c < 3; ++c)
      std::copy_n(row.emission.data() + c * width, width, result_.emission.data() + c * plane + first);
    std::copy_n(row.emissionDepth.data(), width, result_.emissionDepth.data() + first);
    for (size_t x = 0; x < width; ++x) {
      float sum = row.render[x];
      for (size_t c = 0; c < 3; ++c) sum += row.emission[c * width + x] / 3;
      result_.render[first + x] = row.nonFinite[x] ? std::numeric_limits<float>::quiet_NaN() : sum;
      nonFinite_ += row.nonFinite[x];
    }
  }

  const LayerSource& source_;
  const LayerScale& scale_;
  const size_t piece_;
  const int y0_, y1_;
  nn::LayersBand band_;
  LayeredRows result_;
  std::atomic<uint64_t> nonFinite_ = 0;
};

}  // namespace

LayerSource layerSource(const DeepImage& image) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  return {image.dataWindow, image.displayWindow, findLayerInputs(names, image.attributes),
          [&image](int y0, int y1) { return rows(image, y0, y1); },
          [&image](int y0, int y1) {
            const size_t first = image.dataWindow.index(image.dataWindow.x0, y0);
            const size_t pixels = size_t(y1 - y0) * size_t(image.dataWindow.width());
            return sizeof(float) * image.channels.size() * (image.offsets[first + pixels] - image.offsets[first]);
          }};
}

LayerScale measureLayers(const LayerSource& source, const LayersParams& params, const Progress& progress) {
  LayerScaleSum sum(source.dataWindow);
  forPieces(source, source.dataWindow.y0, source.dataWindow.y1, pieceBytes(params), progress,
            [&](const DeepImage& rows) { sum.add(rows, source.inputs); });
  return sum.result();
}

float LayeredRows::brightness(int y, int x) const {
  double passed = 1, sum = 0;
  for (int l = 0; l < band.layers(); ++l) {
    const auto value = [&](size_t plane) { return double(band.row(l, plane, y - frame.y0)[x]); };
    sum += passed * (value(0) + value(1) + value(2));
    passed *= 1 - value(3);
  }
  sum /= double(scale.exposure);
  const size_t plane = render.size(), i = size_t(y - y0) * size_t(frame.width()) + size_t(x);
  for (size_t c = 0; c < 3; ++c) sum += double(emission[c * plane + i]);
  return float(sum / 3);
}

namespace {

// Of a frame or its part, in bands from the top.
template <class Take>
void forBands(const nn::LayersNet& net, const LayersParams& params, const LayerSource& source, const LayerScale& scale,
              int y0, int y1, const Progress& progress, LayersCounts* counts, const Take& take) {
  const Box& window = source.dataWindow;
  const size_t least = leastLayersBytes(net, params.layers, int(scale.lights.size()), window);
  if (params.memory && params.memory < least)
    fail("expected at least {} MB for the layered network, found {} MB", least / 1'000'000 + 1,
         params.memory / 1'000'000);
  const Cut cut = cutFor(net, params, int(scale.lights.size()), window);
  tbb::task_arena arena(cut.threads);
  const int first = y0 - window.y0, last = y1 - window.y0;
  for (int y = first; y < last;) {
    const int end = std::min(last, y / kStep * kStep + cut.rows);
    arena.execute([&] {
      BandRun run(net, params, cut.tile, source, scale, y, end);
      LayeredRows& rows =
          run.run(part(progress, double(y - first) / (last - first), double(end - first) / (last - first)));
      if (counts) {
        counts->filtered += rows.band.filtered();
        counts->skipped += rows.band.skipped();
        counts->nonFinite += run.nonFinite();
      }
      take(rows);
    });
    y = end;
  }
  progress.at(1);
}

flat::LightCurve emptyCurve(const LayerScale& scale) {
  return flat::LightCurve(1 / scale.exposure);
}

void addLight(const LayeredRows& rows, flat::LightCurve& curve) {
  const int width = rows.frame.width();
  std::vector<flat::LightCurve> parts(size_t(rows.y1 - rows.y0), emptyCurve(rows.scale));
  parallelFor(rows.y0, rows.y1, [&](int y) {
    const size_t row = size_t(y - rows.y0);
    for (int x = 0; x < width; ++x) parts[row].add(rows.brightness(y, x), rows.render[row * size_t(width) + size_t(x)]);
  });
  for (const flat::LightCurve& part : parts) curve.add(part);
}

void findFactors(const flat::LightCurve& curve, LayeredRows& rows) {
  if (!curve.changes()) return;
  const int width = rows.frame.width();
  rows.factors = Buffer<float>(rows.render.size());
  parallelFor(rows.y0, rows.y1, [&](int y) {
    for (int x = 0; x < width; ++x)
      rows.factors[size_t(y - rows.y0) * size_t(width) + size_t(x)] = curve.factor(rows.brightness(y, x));
  });
}

}  // namespace

flat::LightCurve measureLight(const nn::LayersNet& net, const LayersParams& params, const LayerSource& source,
                              const LayerScale& scale, const Progress& progress) {
  flat::LightCurve curve = emptyCurve(scale);
  const Box& window = source.dataWindow;
  forBands(net, params, source, scale, window.y0, window.y1, progress, nullptr,
           [&](const LayeredRows& rows) { addLight(rows, curve); });
  curve.fit();
  return curve;
}

void denoiseLayers(const nn::LayersNet& net, const LayersParams& params, const LayerSource& source,
                   const LayerScale& scale, int y0, int y1, const std::function<void(const LayeredRows& rows)>& take,
                   const Progress& progress, LayersCounts* counts) {
  const Box& window = source.dataWindow;
  const bool measures = !scale.light && y0 == window.y0 && y1 == window.y1;
  if (measures && layersBands(net, params, scale, window).size() > 1) {
    LayerScale told = scale;
    told.light = measureLight(net, params, source, scale, part(progress, 0, 0.5));
    denoiseLayers(net, params, source, told, y0, y1, take, part(progress, 0.5, 1), counts);
    return;
  }
  forBands(net, params, source, scale, y0, y1, progress, counts, [&](LayeredRows& rows) {
    if (measures) {
      flat::LightCurve curve = emptyCurve(scale);
      addLight(rows, curve);
      curve.fit();
      findFactors(curve, rows);
    } else if (scale.light) {
      findFactors(*scale.light, rows);
    }
    take(rows);
  });
}

std::vector<std::pair<int, int>> layersBands(const nn::LayersNet& net, const LayersParams& params,
                                             const LayerScale& scale, const Box& window) {
  const Cut cut = cutFor(net, params, int(scale.lights.size()), window);
  std::vector<std::pair<int, int>> result;
  for (int y = 0; y < window.height(); y += cut.rows)
    result.emplace_back(window.y0 + y, window.y0 + std::min(y + cut.rows, window.height()));
  return result;
}

size_t leastLayersBytes(const nn::LayersNet& net, int layers, int lights, const Box& dataWindow) {
  const double bytes =
      bandBytes(net, layers, lights, dataWindow, kStep) + tileBytes(net, kTiles[std::size(kTiles) - 1]);
  return size_t(bytes * 8 / 7) + kLeastPiece;
}

size_t mostLayersBytes(const nn::LayersNet& net, int layers, int lights, const Box& dataWindow) {
  const double tiles = tbb::this_task_arena::max_concurrency();
  const double work =
      bandBytes(net, layers, lights, dataWindow, rounded(dataWindow.height())) + tiles * tileBytes(net, kTiles[0]);
  return size_t(work) + kMostPiece;
}

}  // namespace fathom::deep
