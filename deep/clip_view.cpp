// Pixel by pixel: what is left of its samples is found and composited from depths and alphas alone; the channels are then
// sums over that.
#include "deep/clip_view.h"

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "deep/channels.h"
#include "deep/pixel_view.h"
#include "flat/limited.h"

namespace fathom::deep {

namespace {

constexpr int kRows = 8;  // of a tile; its scratch is allocated once
constexpr size_t kTogether = PixelView::kTogether;

// The sum of a channel over a pixel's parts, weighted by weightOf(part).
template <class WeightOf>
float sum(const PixelParts& parts, const float* values, const WeightOf& weightOf) {
  double total = 0;
  for (size_t i = 0; i < parts.count; ++i) total += weightOf(i) * double(finiteOrZero(values[parts.sample[i]]));
  return limited(total);
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

std::vector<Output> planOutputs(const DeepImage& image, const std::vector<std::string>& channels,
                                std::span<float* const> planes) {
  std::vector<Output> outputs;
  for (size_t c = 0; c < channels.size(); ++c)
    outputs.push_back({kindOf(channels[c]), image.get(channels[c]).data(), planes[c]});
  outputs.push_back({Output::Kind::Alpha, image.get("A").data(), planes[channels.size()]});
  return outputs;
}

float valueOf(const PixelView& view, const Output& output) {
  using Kind = Output::Kind;
  const PixelParts& parts = view.parts();
  const double alpha = view.alpha();
  if (parts.count == 0) return 0;
  switch (output.kind) {
    case Kind::Alpha:
      return float(alpha);
    case Kind::Front:
      return view.depths().middle();
    case Kind::Back:
      return view.depths().back();
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
  PixelView::Values values;
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
    PixelView::Totals totals;
    plan.alpha[to] = float(view.compositeTidy(plan.values, totals));
    for (size_t c = 0; c < kTogether; ++c)
      if (plan.colours[c]) plan.colours[c][to] = limited(totals[c]);
    return;
  }
  view.composite();
  for (const Output& output : plan.outputs) output.out[to] = valueOf(view, output);
}

}  // namespace

void clipViewInto(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                  const std::vector<std::string>& channels, std::span<float* const> planes) {
  const Box window{0, 0, (box.width() + step - 1) / step, (box.height() + step - 1) / step};
  const Plan plan(planOutputs(image, channels, planes));
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
}

flat::Image clipView(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                     const std::vector<std::string>& channels) {
  const Box window{0, 0, (box.width() + step - 1) / step, (box.height() + step - 1) / step};
  flat::Image result{window, window, {}, {}};
  std::vector<std::string> names;
  for (const std::string& channel : channels)
    if (channel != "A" && std::ranges::find(names, channel) == names.end()) names.push_back(channel);
  for (const std::string& name : names) result.planes.push_back({name, Buffer<float>(window.area())});
  result.planes.push_back({"A", Buffer<float>(window.area())});
  std::vector<float*> planes;
  for (flat::Plane& plane : result.planes) planes.push_back(plane.values.data());
  clipViewInto(image, box, step, range, names, planes);
  return result;
}

}  // namespace fathom::deep
