// The halves. The paper's halves are the even and the odd camera samples, but a file of samples is sorted by depth and
// no longer tells which was which. Taking turns in depth would be biased (one half always begins with the nearer
// sample) and its halves too alike. Camera samples are exchangeable: given what was seen, every way to number them is
// as likely. So the n camera samples of a pixel, those that saw nothing included, are dealt to an even half of
// ceil(n/2) and an odd one by a hash of the pixel's coordinates: the same statistics as the renderer's own halves, the
// same bits for any band of rows, and no look at any value.
#include "deep/cluster_plan.h"

#include <cmath>
#include <numeric>

namespace fathom::deep {

namespace {

struct Pixel {
  int x, y;
  size_t first, count;  // its samples in the image
  size_t inRow;         // its first sample in the row
  std::span<const float> bins;
  size_t firstBin;            // its first bin in the row
  std::vector<size_t> order;  // sample numbers, front to back
};

void sortByDepth(const SampleGeometry& samples, Pixel& pixel) {
  pixel.order.resize(pixel.count);
  std::iota(pixel.order.begin(), pixel.order.end(), size_t(0));
  const auto front = [&](size_t a, size_t b) {
    return samples.depth(pixel.first + a) < samples.depth(pixel.first + b);
  };
  if (!std::is_sorted(pixel.order.begin(), pixel.order.end(), front))
    std::stable_sort(pixel.order.begin(), pixel.order.end(), front);
}

void assign(const SampleGeometry& samples, const Pixel& pixel, ClusterPlan& plan) {
  for (size_t i = 0; i < pixel.count; ++i) {
    if (pixel.bins.empty()) {
      plan.bin.push_back(ClusterPlan::kNoBin);
    } else {
      plan.bin.push_back(uint32_t(pixel.firstBin + nearestBin(pixel.bins, samples.depth(pixel.first + i))));
      ++plan.count[plan.bin.back()];
    }
  }
}

bool allSeen(const SampleGeometry& samples, const Pixel& pixel, double part) {
  double passed = 1;
  for (const size_t i : pixel.order) {
    const double a = opacity(samples.alpha[pixel.first + i]);
    if (!(std::abs(passed * a / part - 1) <= samples.tolerance)) return false;
    passed *= 1 - a;
  }
  return true;
}

// How many camera samples the pixel had, if each of its samples is one of them: then all have the same effective alpha.
// Else 0.
uint32_t countCameraSamples(const SampleGeometry& samples, const Pixel& pixel) {
  if (pixel.count == 0) return 0;
  if (samples.spp > 0 && size_t(samples.spp) >= pixel.count && allSeen(samples, pixel, 1.0 / samples.spp))
    return uint32_t(samples.spp);
  const double told = std::round(1 / opacity(samples.alpha[pixel.first + pixel.order[0]]));
  return told < 1e6 && told >= double(pixel.count) && allSeen(samples, pixel, 1 / told) ? uint32_t(told) : 0;
}

// Alphas such that the products with what stands in front come as near to counts / cameraSamples as floats can.
void weighEqually(const SampleGeometry& samples, const Pixel& pixel, uint32_t cameraSamples, ClusterPlan& plan) {
  for (size_t i = 0; i < pixel.count; ++i) {
    plan.weight.push_back(1);
    plan.factor.push_back(1 / opacity(samples.alpha[pixel.first + i]));
  }
  double passed = 1;
  uint32_t left = cameraSamples;
  for (size_t b = pixel.firstBin; b < pixel.firstBin + pixel.bins.size(); ++b) {
    const uint32_t n = plan.count[b];
    const bool last = n > 0 && n == left;
    const float alpha = n == 0 ? 0.0f : last ? 1.0f : float(double(n) / cameraSamples / passed);
    plan.alpha.push_back(alpha);
    passed *= 1 - double(alpha);
    left -= n;
  }
}

// Each bin composited by itself.
void weighByAlpha(const SampleGeometry& samples, const Pixel& pixel, ClusterPlan& plan) {
  std::vector<double> passed(pixel.bins.size(), 1), alpha(pixel.bins.size(), 0);
  plan.weight.resize(plan.bin.size(), 0);
  plan.factor.resize(plan.bin.size(), 0);
  for (const size_t i : pixel.order) {
    if (pixel.bins.empty()) break;
    const size_t sample = pixel.inRow + i, b = plan.bin[sample] - pixel.firstBin;
    const double a = opacity(samples.alpha[pixel.first + i]);
    plan.factor[sample] = passed[b];
    plan.weight[sample] = passed[b] * a;
    alpha[b] += passed[b] * a;
    passed[b] *= 1 - a;
  }
  for (const double a : alpha) plan.alpha.push_back(float(a));
}

// 32 random bits, a function of all three.
uint32_t randomBits(int x, int y, size_t k) {
  uint64_t h = (uint64_t(uint32_t(y)) << 32 | uint32_t(x)) * 0x9E3779B97F4A7C15u + (k + 1) * 0xC2B2AE3D27D4EB4Fu;
  for (int round = 0; round < 3; ++round) h = (h ^ (h >> 32)) * 0xD6E8FEB86659FD93u;
  return uint32_t(h >> 32);
}

// Deals camera samples to the halves; those that are not in the file take what is left.
void deal(const Pixel& pixel, uint32_t cameraSamples, ClusterPlan& plan) {
  uint32_t left = cameraSamples, even = cameraSamples - cameraSamples / 2;
  for (size_t i = 0; i < pixel.count; ++i, --left) {
    const bool isEven = (uint64_t(randomBits(pixel.x, pixel.y, i)) * left) >> 32 < even;
    plan.half.push_back(isEven ? 0 : 1);
    if (isEven) --even;
  }
}

// Bins that hold volumes reach as far as those, but not beyond halfway to the next bin.
void extend(const SampleGeometry& samples, const Pixel& pixel, ClusterPlan& plan) {
  const size_t bins = pixel.bins.size();
  std::vector<Range> extents(bins, {FLT_MAX, -FLT_MAX});
  std::vector<bool> volume(bins, false);
  for (size_t i = 0; i < pixel.count && bins > 0; ++i) {
    const size_t b = plan.bin[pixel.inRow + i] - pixel.firstBin;
    const Range range = samples.range(pixel.first + i);
    extents[b] = {std::min(extents[b].z, range.z), std::max(extents[b].zBack, range.zBack)};
    if (!range.isPoint()) volume[b] = true;
  }
  const auto halfway = [&](size_t b) { return float((double(pixel.bins[b]) + double(pixel.bins[b + 1])) / 2); };
  for (size_t b = 0; b < bins; ++b) {
    const float z = b > 0 ? std::max(extents[b].z, halfway(b - 1)) : extents[b].z;
    const float zBack = b + 1 < bins ? std::min(extents[b].zBack, halfway(b)) : extents[b].zBack;
    if (!volume[b] || !(z < zBack)) continue;
    plan.z[pixel.firstBin + b] = z;
    plan.zBack[pixel.firstBin + b] = zBack;
  }
}

void planPixel(const SampleGeometry& samples, const BinLayout& layout, Pixel& pixel, ClusterPlan& plan) {
  const BinLayout::Span bins = layout.at(pixel.x, pixel.y);
  pixel.first = samples.image.offsets[samples.image.dataWindow.index(pixel.x, pixel.y)];
  pixel.count = samples.image.count(samples.image.dataWindow.index(pixel.x, pixel.y));
  pixel.inRow = plan.bin.size();
  pixel.bins = {layout.depth.data() + bins.begin, bins.size()};
  pixel.firstBin = plan.count.size();
  plan.count.resize(pixel.firstBin + bins.size(), 0);
  plan.z.insert(plan.z.end(), pixel.bins.begin(), pixel.bins.end());
  plan.zBack.insert(plan.zBack.end(), pixel.bins.begin(), pixel.bins.end());
  sortByDepth(samples, pixel);
  assign(samples, pixel, plan);
  const uint32_t cameraSamples = countCameraSamples(samples, pixel);
  if (cameraSamples > 0)
    weighEqually(samples, pixel, cameraSamples, plan);
  else
    weighByAlpha(samples, pixel, plan);
  if (!layout.alpha.empty())
    std::copy_n(layout.alpha.begin() + bins.begin, bins.size(), plan.alpha.end() - std::ptrdiff_t(bins.size()));
  deal(pixel, cameraSamples > 0 ? cameraSamples : uint32_t(pixel.count), plan);
  if (!samples.zBack.empty()) extend(samples, pixel, plan);
}

}  // namespace

SampleGeometry::SampleGeometry(const DeepImage& samples)
    : image(samples),
      alpha(samples.get("A")),
      z(samples.get("Z")),
      zBack(samples.tryGet("ZBack")),
      spp(samples.attributes.getInt("fathom:spp").value_or(0)),
      tolerance(samples.find("A")->type == PixelType::Half ? 5e-3 : 1e-5) {}

ClusterPlan planRow(const SampleGeometry& samples, const BinLayout& layout, int y) {
  ClusterPlan plan;
  Pixel pixel{};
  pixel.y = y;
  for (pixel.x = samples.image.dataWindow.x0; pixel.x < samples.image.dataWindow.x1; ++pixel.x)
    planPixel(samples, layout, pixel, plan);
  return plan;
}

}  // namespace fathom::deep
