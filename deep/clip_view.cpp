// Pixel by pixel: what is left of its samples is found and composited from depths and alphas alone; the channels are then
// sums over that. The usual pixel, whose parts go from front to back and do not meet, takes one pass; any other goes
// through PixelPieces.
#include "deep/clip_view.h"

#include <algorithm>
#include <cmath>

#include "deep/channels.h"
#include "deep/pixel_pieces.h"
#include "flat/finite.h"
#include "flat/parallel.h"

namespace fathom::deep {

namespace {

constexpr int kRows = 8;  // of a tile; its scratch is allocated once
constexpr float kInfinity = std::numeric_limits<float>::infinity();

constexpr size_t kTogether = 3;  // channels that are summed at once: a colour

using Values = std::array<const float*, kTogether>;
using Totals = std::array<double, kTogether>;

// What is left of a pixel's samples, part by part in their order, and what each adds to the pixel.
struct Parts {
  std::vector<size_t> sample;
  std::vector<float> z, zBack, alpha, weight;
  std::vector<double> factor, seen;  // of premultiplied values; effective alpha
  size_t count = 0;

  // For the parts of so many samples.
  void makeRoom(size_t samples) {
    if (2 * samples <= sample.size()) return;
    sample.resize(2 * samples);
    for (auto* values : {&z, &zBack, &alpha, &weight}) values->resize(2 * samples);
    for (auto* values : {&factor, &seen}) values->resize(2 * samples);
  }
  Range range(size_t i) const { return {z[i], zBack[i]}; }

  // Adds parts from the first one on. A copy of the pointers: they stay in registers.
  struct Writer {
    size_t* sample;
    float *z, *zBack, *alpha, *weight;
    size_t count = 0;

    explicit Writer(Parts& to)
        : sample(to.sample.data()),
          z(to.z.data()),
          zBack(to.zBack.data()),
          alpha(to.alpha.data()),
          weight(to.weight.data()) {}
    void add(size_t of, const Range& range, float alphaHere, float weightHere) {
      sample[count] = of;
      z[count] = range.z;
      zBack[count] = range.zBack;
      alpha[count] = alphaHere;
      weight[count] = weightHere;
      ++count;
    }
  };
};

// What compositing front to back adds up.
struct Sums {
  double passed = 1, alpha = 0;

  // Returns the transmittance in front.
  double put(double alphaHere) {
    const double front = passed;
    alpha += front * alphaHere;
    passed = front * (1 - alphaHere);
    return front;
  }
};

// The mean depths of what is seen; of the nearest where nothing is. What lies at infinity has no say beside others.
struct Depths {
  double middle = 0, back = 0, alpha = 0;
  Range nearest{kInfinity, kInfinity};

  void put(const Range& range, double seen) {
    if (range.z < nearest.z) nearest = range;
    if (!std::isfinite(range.z)) return;
    middle += seen * range.middle();
    back += seen * double(range.zBack);
    alpha += seen;
  }
  float meanMiddle() const { return alpha > 0 ? float(middle / alpha) : nearest.z; }
  float meanBack() const { return alpha > 0 ? float(back / alpha) : nearest.zBack; }
};

// Composites one pixel after the other; its scratch is allocated once.
class PixelView {
 public:
  PixelView(const DeepImage& image, const DepthRange& range)
      : image_(image),
        cut_(range),
        alpha_(image.get("A")),
        z_(image.get("Z")),
        zBack_(image.tryGet("ZBack")),
        mergePoints_(!holdsStatistics(image)) {
    if (zBack_.empty()) zBack_ = z_;
  }

  // Finds the parts of a pixel. True where it is a usual one: they go from front to back and do not meet.
  bool set(size_t pixel) {
    const uint64_t begin = image_.offsets[pixel], end = image_.offsets[pixel + 1];
    const float *const z = z_.data(), *const zBack = zBack_.data(), *const alphas = alpha_.data();
    const bool mergePoints = mergePoints_;
    const RangeCut cut = cut_;
    parts_.makeRoom(end - begin);
    Parts::Writer to(parts_);
    bool tidy = true;
    float before = -kInfinity, behind = -kInfinity;  // where the last part began and ended
    const auto add = [&](size_t i, const Range& range, float alpha, float weight) {
      tidy &= !((range.z < behind) | (mergePoints & (range.zBack == before)));
      before = range.z;
      behind = range.zBack;
      to.add(i, range, alpha, weight);
    };
    for (size_t i = begin; i < end; ++i) {
      const Range range = usableRange(z[i], zBack[i]);
      if (cut.leavesNothing(range)) continue;
      if (cut.leavesWhole(range)) {
        add(i, range, float(opacity(alphas[i])), 1);
        continue;
      }
      std::array<Fragment, 2> room;
      for (const Fragment& part : cut_.cut(range, opacity(alphas[i]), room))
        add(i, part.range, float(part.alpha), float(part.weight));
    }
    parts_.count = to.count;
    return tidy;
  }

  // Of a usual pixel: its alpha and some composited channels.
  double compositeTidy(const Values& values, Totals& result) const {
    const size_t *const samples = parts_.sample.data(), count = parts_.count;
    const float *const alphas = parts_.alpha.data(), *const weights = parts_.weight.data();
    Sums sums;
    Totals totals = {};
    for (size_t i = 0; i < count; ++i) {
      const double factor = sums.put(double(alphas[i])) * double(weights[i]);
      for (size_t c = 0; c < kTogether; ++c) totals[c] += factor * double(finiteOrZero(values[c][samples[i]]));
    }
    result = totals;
    return sums.alpha;
  }

  // All that there is to know about a pixel, its parts' factors among it.
  void composite(size_t pixel, bool tidy) {
    sums_ = {};
    depths_ = {};
    if (tidy)
      weighTidy();
    else
      weighAny(pixel);
  }

  const Parts& parts() const { return parts_; }
  double alpha() const { return sums_.alpha; }
  const Depths& depths() const { return depths_; }

 private:
  void weighTidy() {
    for (size_t i = 0; i < parts_.count; ++i) {
      const double alpha = double(parts_.alpha[i]), front = sums_.put(alpha);
      parts_.factor[i] = front * double(parts_.weight[i]);
      parts_.seen[i] = front * alpha;
      depths_.put(parts_.range(i), front * alpha);
    }
  }

  void weighAny(size_t pixel) {
    const size_t count = parts_.count;
    std::fill_n(parts_.factor.begin(), count, 0.0);
    std::fill_n(parts_.seen.begin(), count, 0.0);
    pieces_.set({parts_.z.data(), count}, {parts_.zBack.data(), count});
    pieces_.checkOverlaps(mergePoints_, image_.dataWindow, pixel);
    pieces_.visit({parts_.alpha.data(), count}, mergePoints_, [&](const Piece& piece) {
      const double front = sums_.put(piece.alpha), seen = front * piece.alpha;
      depths_.put(piece.range, seen);
      for (const Share& share : piece.shares) {
        parts_.factor[share.sample] += front * share.weight * double(parts_.weight[share.sample]);
        parts_.seen[share.sample] += seen * share.part;
      }
    });
  }

  const DeepImage& image_;
  RangeCut cut_;
  std::span<const float> alpha_, z_, zBack_;
  bool mergePoints_;
  Parts parts_;
  Sums sums_;
  Depths depths_;
  PixelPieces pieces_;
};

// The sum of a channel over a pixel's parts, weighted by weightOf(part).
template <class WeightOf>
float sum(const Parts& parts, const float* values, const WeightOf& weightOf) {
  double total = 0;
  for (size_t i = 0; i < parts.count; ++i) total += weightOf(i) * double(finiteOrZero(values[parts.sample[i]]));
  return float(total);
}

// A plane of the result and what it is made of.
struct Output {
  enum class Kind { Alpha, Front, Back, Composited, Mean, Variance, Count };
  Kind kind;
  const float* values;  // per sample
  float* out;           // per pixel
};

Output::Kind kindOf(const std::string& name) {
  using Kind = Output::Kind;
  switch (roleOf(name, PixelType::Float)) {
    case Role::Alpha:
      return Kind::Alpha;
    case Role::Depth:
      return name == "Z" ? Kind::Front : Kind::Back;
    case Role::Plain:
      return Kind::Mean;
    case Role::Statistic:
      return name.starts_with("variance.") ? Kind::Variance : Kind::Count;
    default:
      return Kind::Composited;
  }
}

// Adds the planes to `result`.
std::vector<Output> planOutputs(const DeepImage& image, std::vector<std::string> names, flat::Image& result) {
  std::vector<Output> outputs;
  names.emplace_back("A");
  for (const std::string& name : names) {
    if (result.find(name)) continue;
    const float* values = image.get(name).data();
    result.planes.push_back({name, Buffer<float>(result.dataWindow.area())});
    outputs.push_back({kindOf(name), values, result.planes.back().values.data()});
  }
  return outputs;
}

float valueOf(const PixelView& view, const Output& output) {
  using Kind = Output::Kind;
  const Parts& parts = view.parts();
  const double alpha = view.alpha();
  if (parts.count == 0) return 0;
  switch (output.kind) {
    case Kind::Alpha:
      return float(alpha);
    case Kind::Front:
      return view.depths().meanMiddle();
    case Kind::Back:
      return view.depths().meanBack();
    case Kind::Composited:
      return sum(parts, output.values, [&](size_t i) { return parts.factor[i]; });
    case Kind::Mean:
      return sum(parts, output.values, [&](size_t i) { return alpha > 0 ? parts.seen[i] / alpha : 0; });
    case Kind::Variance:
      return sum(parts, output.values, [&](size_t i) { return parts.factor[i] * parts.factor[i]; });
    default:  // a sample of two parts counts once
      return sum(parts, output.values,
                 [&](size_t i) { return i > 0 && parts.sample[i - 1] == parts.sample[i] ? 0 : 1; });
  }
}

// Colours that are composited at once.
struct Plan {
  std::vector<Output> outputs;
  bool isColour;  // A and at most kTogether composited channels: the usual view
  std::array<float*, kTogether> colours = {};
  Values values;
  float* alpha;

  explicit Plan(std::vector<Output> all) : outputs(std::move(all)) {
    size_t count = 0;
    isColour = outputs.size() <= kTogether + 1;
    for (const Output& output : outputs) {
      if (output.kind == Output::Kind::Alpha)
        alpha = output.out;
      else if (output.kind != Output::Kind::Composited)
        isColour = false;
      else if (count < kTogether)
        colours[count] = output.out, values[count++] = output.values;
    }
    for (; count < kTogether; ++count) values[count] = outputs[0].values;
  }
};

void write(const Plan& plan, PixelView& view, size_t pixel, size_t to) {
  const bool tidy = view.set(pixel);
  if (tidy && plan.isColour) {
    Totals totals;
    plan.alpha[to] = float(view.compositeTidy(plan.values, totals));
    for (size_t c = 0; c < kTogether; ++c)
      if (plan.colours[c]) plan.colours[c][to] = float(totals[c]);
    return;
  }
  view.composite(pixel, tidy);
  for (const Output& output : plan.outputs) output.out[to] = valueOf(view, output);
}

}  // namespace

flat::Image clipView(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                     const std::vector<std::string>& channels) {
  const Box window{0, 0, (box.width() + step - 1) / step, (box.height() + step - 1) / step};
  flat::Image result{window, window, {}, {}};
  const Plan plan(planOutputs(image, channels, result));
  (void)PixelView(image, range);  // throws for images without rows, too
  parallelRanges(0, window.height(), kRows, [&](int y0, int y1) {
    PixelView view(image, range);
    for (int y = y0; y < y1; ++y)
      for (int x = 0; x < window.x1; ++x) {
        const size_t to = window.index(x, y);
        const int fromX = box.x0 + x * step, fromY = box.y0 + y * step;
        if (image.dataWindow.contains(fromX, fromY))
          write(plan, view, image.dataWindow.index(fromX, fromY), to);
        else
          for (const Output& output : plan.outputs) output.out[to] = 0;
      }
  });
  return result;
}

}  // namespace fathom::deep
