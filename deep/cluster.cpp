// Source: Vicini et al., "Denoising Deep Monte Carlo Renderings", sections 4.2 and 5.1. Where the bins lie is decided
// in deep/bin_layout, what each sample adds to which bin and half in deep/cluster_plan; here the channels follow.
#include "deep/cluster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/channels.h"
#include "deep/cluster_plan.h"
#include "flat/limited.h"

namespace fathom::deep {

namespace {

bool inGroup(std::string_view name, std::string_view group) {
  return name.size() > group.size() && name.starts_with(group) && name[group.size()] == '.';
}

bool hasHalves(std::string_view name) {
  return name == "R" || name == "G" || name == "B" || inGroup(name, "diffuse") || inGroup(name, "specular") ||
         inGroup(name, "albedo");
}

bool hasVariance(std::string_view name) {
  return hasHalves(name) || inGroup(name, "N");
}

enum class Statistic { Mean, PlainMean, Half0, Half1, Variance, Id };

// One channel of the result and where it comes from.
struct Output {
  Statistic what;
  const Channel* in;
  size_t out;  // number of the channel
};

// The channels of the result apart from those that the plan decides.
std::vector<Output> planChannels(const DeepImage& samples, DeepImage& result) {
  std::vector<Output> outputs;
  const auto add = [&](const Channel& in, Statistic what, const std::string& prefix, PixelType type) {
    outputs.push_back({what, &in, result.channels.size()});
    result.add(prefix + in.name, type);
  };
  for (const Channel& channel : samples.channels) {
    const Role role = roleOf(channel);
    if (role == Role::Premultiplied) add(channel, Statistic::Mean, "", channel.type);
    if (role == Role::Plain) add(channel, Statistic::PlainMean, "", channel.type);
    if (role == Role::Identifier) add(channel, Statistic::Id, "", channel.type);
    if (role == Role::Premultiplied && hasVariance(channel.name))
      add(channel, Statistic::Variance, "variance.", PixelType::Float);
    if (role == Role::Premultiplied && hasHalves(channel.name)) {
      add(channel, Statistic::Half0, "half0.", channel.type);
      add(channel, Statistic::Half1, "half1.", channel.type);
    }
  }
  return outputs;
}

// A sample with a non-finite value anywhere weighs nothing.
void removePoisoned(const std::vector<Output>& outputs, size_t firstSample, ClusterPlan& plan) {
  for (const Output& output : outputs) {
    if (output.what != Statistic::Mean) continue;
    const float* values = output.in->values.data() + firstSample;
    for (size_t i = 0; i < plan.bin.size(); ++i)
      if (!isFinite(values[i])) plan.weight[i] = plan.factor[i] = 0;
  }
}

// Per bin, sums over the samples that have a say: of all and of each half.
struct Totals {
  std::array<std::vector<double>, 3> weight;
  std::array<std::vector<uint32_t>, 3> count;
  std::vector<double> squares;
};
constexpr size_t kAll = 2;

Totals sumUp(const ClusterPlan& plan) {
  const size_t bins = plan.count.size();
  Totals totals;
  for (auto& weight : totals.weight) weight.resize(bins, 0);
  for (auto& count : totals.count) count.resize(bins, 0);
  totals.squares.resize(bins, 0);
  for (size_t i = 0; i < plan.bin.size(); ++i) {
    if (plan.bin[i] == ClusterPlan::kNoBin) continue;
    totals.squares[plan.bin[i]] += plan.weight[i] * plan.weight[i];
    for (const size_t set : {size_t(plan.half[i]), kAll}) totals.weight[set][plan.bin[i]] += plan.weight[i];
  }
  for (size_t i = 0; i < plan.bin.size(); ++i) {
    if (plan.bin[i] == ClusterPlan::kNoBin) continue;
    // In a bin without any alpha what shines has a say.
    const bool heard = totals.weight[kAll][plan.bin[i]] > 0 ? plan.weight[i] > 0 : plan.factor[i] > 0;
    if (!heard) continue;
    for (const size_t set : {size_t(plan.half[i]), kAll}) ++totals.count[set][plan.bin[i]];
  }
  return totals;
}

// Everything that the channels of one row need.
struct Row {
  ClusterPlan plan;
  Totals totals;

  // Adds term(sample) to the sample's bin, over all samples or those of one half.
  template <class Term>
  std::vector<double> sum(size_t set, const Term& term) const {
    std::vector<double> result(plan.count.size(), 0);
    for (size_t i = 0; i < plan.bin.size(); ++i)
      if (plan.bin[i] != ClusterPlan::kNoBin && (set == kAll || plan.half[i] == set)) result[plan.bin[i]] += term(i);
    return result;
  }
};

// The premultiplied mean over all samples or over a half.
void mean(const Row& row, size_t set, const float* in, float* out) {
  const Totals& totals = row.totals;
  const std::vector<double> sums =
      row.sum(set, [&](size_t i) { return row.plan.factor[i] > 0 ? row.plan.factor[i] * double(in[i]) : 0; });
  for (size_t b = 0; b < sums.size(); ++b) {
    const double weight = totals.weight[set][b], heard = totals.count[set][b];
    if (weight > 0)
      out[b] = limited(sums[b] / weight * double(row.plan.alpha[b]));
    else
      out[b] = totals.weight[kAll][b] == 0 && heard > 0 ? limited(sums[b] * totals.count[kAll][b] / heard) : 0.0f;
  }
}

void plainMean(const Row& row, const float* in, float* out) {
  const std::vector<double> weighted =
      row.sum(kAll, [&](size_t i) { return row.plan.weight[i] * double(finiteOrZero(in[i])); });
  const std::vector<double> plain = row.sum(kAll, [&](size_t i) { return double(finiteOrZero(in[i])); });
  for (size_t b = 0; b < weighted.size(); ++b) {
    const double weight = row.totals.weight[kAll][b];
    out[b] = weight > 0              ? float(weighted[b] / weight)
             : row.plan.count[b] > 0 ? float(plain[b] / row.plan.count[b])
                                     : 0.0f;
  }
}

// The variance of the weighted mean of value(i), from how the samples scatter. With equal weights: their sample
// variance over their number.
template <class Value>
void varianceOfMean(const Row& row, const Value& value, float* out) {
  const ClusterPlan& plan = row.plan;
  const std::vector<double>& weights = row.totals.weight[kAll];
  std::vector<double> means =
      row.sum(kAll, [&](size_t i) { return plan.weight[i] > 0 ? plan.weight[i] * value(i) : 0; });
  for (size_t b = 0; b < means.size(); ++b) means[b] = weights[b] > 0 ? means[b] / weights[b] : 0;
  const std::vector<double> scatter = row.sum(kAll, [&](size_t i) {
    const double d = plan.weight[i] > 0 ? value(i) - means[plan.bin[i]] : 0;
    return plan.weight[i] * d * d;
  });
  for (size_t b = 0; b < means.size(); ++b) {
    const double part =
        weights[b] > 0 ? row.totals.squares[b] / (weights[b] * weights[b]) : 1;  // 1 / n for equal weights
    out[b] = part < 1 - 1e-12 ? limited(scatter[b] / weights[b] * part / (1 - part)) : 0.0f;
  }
}

// The id with the largest sum of weights in each bin; the smallest of those as large.
void largestId(const ClusterPlan& plan, const uint32_t* in, uint32_t* out) {
  std::vector<size_t> order;
  for (size_t i = 0; i < plan.bin.size(); ++i)
    if (plan.bin[i] != ClusterPlan::kNoBin) order.push_back(i);
  std::sort(order.begin(), order.end(),
            [&](size_t a, size_t b) { return std::tie(plan.bin[a], in[a], a) < std::tie(plan.bin[b], in[b], b); });
  std::fill_n(out, plan.count.size(), 0u);
  uint32_t bin = ClusterPlan::kNoBin;
  double most = 0;
  for (size_t k = 0; k < order.size();) {
    const size_t first = order[k];
    double weight = 0;
    for (; k < order.size() && plan.bin[order[k]] == plan.bin[first] && in[order[k]] == in[first]; ++k)
      weight += plan.weight[order[k]];
    if (plan.bin[first] == bin && weight <= most) continue;
    bin = plan.bin[first];
    most = weight;
    out[bin] = in[first];
  }
}

// Ids are written before, while poisoned samples still weigh something.
void writeOutput(const Output& output, const Row& row, size_t firstSample, Channel& channel, size_t firstBin) {
  if (output.what == Statistic::Id) return;
  const float* in = output.in->values.data() + firstSample;
  float* out = channel.values.data() + firstBin;
  const auto value = [&](size_t i) { return double(in[i]) * row.plan.factor[i] / row.plan.weight[i]; };
  switch (output.what) {
    case Statistic::Mean:
      mean(row, kAll, in, out);
      break;
    case Statistic::Half0:
      mean(row, 0, in, out);
      break;
    case Statistic::Half1:
      mean(row, 1, in, out);
      break;
    case Statistic::PlainMean:
      plainMean(row, in, out);
      break;
    case Statistic::Variance:
      varianceOfMean(row, value, out);
      break;
    case Statistic::Id:
      break;
  }
}

void refuseBins(const DeepImage& samples) {
  for (const Channel& channel : samples.channels)
    if (describesSamples(roleOf(channel)))
      fail("channel {}: expected single samples, found statistics of samples that were clustered before", channel.name);
}

Buffer<uint64_t> binOffsets(const Box& window, const BinLayout& layout) {
  Buffer<uint64_t> offsets(window.area() + 1, 0);
  size_t pixel = 0;
  for (int y = window.y0; y < window.y1; ++y)
    for (int x = window.x0; x < window.x1; ++x, ++pixel) offsets[pixel + 1] = offsets[pixel] + layout.at(x, y).size();
  return offsets;
}

}  // namespace

DeepImage cluster(const DeepImage& samples, const BinLayout& layout) {
  refuseBins(samples);
  const SampleGeometry geometry(samples);
  const Box& window = samples.dataWindow;
  DeepImage result{window, samples.displayWindow, binOffsets(window, layout), {}, samples.attributes};
  result.attributes.erase("deepImageState");
  const std::vector<Output> outputs = planChannels(samples, result);
  std::vector<std::string> decided = {"A", "Z", "variance.Z", "samples", "half0.samples", "half1.samples"};
  if (!geometry.zBack.empty()) decided.emplace_back("ZBack");
  for (const std::string& name : decided) result.add(name, PixelType::Float);
  parallelFor(window.y0, window.y1, [&](int y) {
    const size_t pixel = window.index(window.x0, y), sample = samples.offsets[pixel], bin = result.offsets[pixel];
    const auto at = [&](const char* name) { return result.get(name).data() + bin; };
    Row row{planRow(geometry, layout, y), {}};
    for (const Output& output : outputs)
      if (output.what == Statistic::Id)
        largestId(row.plan, output.in->ids.data() + sample, result.channels[output.out].ids.data() + bin);
    removePoisoned(outputs, sample, row.plan);
    row.totals = sumUp(row.plan);
    std::copy(row.plan.alpha.begin(), row.plan.alpha.end(), at("A"));
    std::copy(row.plan.z.begin(), row.plan.z.end(), at("Z"));
    if (!geometry.zBack.empty()) std::copy(row.plan.zBack.begin(), row.plan.zBack.end(), at("ZBack"));
    std::copy(row.plan.count.begin(), row.plan.count.end(), at("samples"));
    std::copy(row.totals.count[0].begin(), row.totals.count[0].end(), at("half0.samples"));
    std::copy(row.totals.count[1].begin(), row.totals.count[1].end(), at("half1.samples"));
    varianceOfMean(
        row, [&](size_t i) { return double(geometry.depth(sample + i)); }, at("variance.Z"));
    for (const Output& output : outputs) writeOutput(output, row, sample, result.channels[output.out], bin);
  });
  return result;
}

}  // namespace fathom::deep
