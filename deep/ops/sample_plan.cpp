#include "deep/ops/sample_plan.h"

#include <algorithm>

#include "deep/channels.h"
#include "flat/finite.h"

namespace fathom::deep {

namespace {

// The share with the largest part, the first where several have it.
const RowPlan::Share& largest(std::span<const RowPlan::Share> shares) {
  return *std::max_element(shares.begin(), shares.end(), [](const auto& a, const auto& b) { return a.part < b.part; });
}

float mixed(std::span<const RowPlan::Share> shares, Role role, const Buffer<float>& values) {
  double sum = 0;
  for (const RowPlan::Share& share : shares)
    sum += double(role == Role::Plain ? share.part : share.weight) * double(finiteOrZero(values[share.sample]));
  return float(sum);
}

float valueOf(const RowPlan& row, size_t i, Role role, bool back, const Buffer<float>& values) {
  const RowPlan::Sample& sample = row.sample(i);
  const std::span<const RowPlan::Share> shares = row.shares(i);
  if (sample.whole) return values[shares[0].sample];
  switch (role) {
    case Role::Depth:
      return back ? sample.zBack : sample.z;
    case Role::Alpha:
      return sample.alpha;
    case Role::Statistic:
      return shares.empty() ? 0 : values[largest(shares).sample];
    default:
      return mixed(shares, role, values);
  }
}

void fillRow(const RowPlan& row, const Channel& from, size_t at, Channel& to) {
  const Role role = roleOf(from);
  const bool back = from.name == "ZBack";
  if (role == Role::Identifier)
    for (size_t i = 0; i < row.samples(); ++i) {
      const std::span<const RowPlan::Share> shares = row.shares(i);
      to.ids[at + i] = shares.empty() ? 0 : from.ids[largest(shares).sample];
    }
  else
    for (size_t i = 0; i < row.samples(); ++i) to.values[at + i] = valueOf(row, i, role, back, from.values);
}

}  // namespace

void RowPlan::mix(std::span<const Share> shares, float z, float zBack, float alpha) {
  samples_.push_back({uint32_t(shares_.size()), false, z, zBack, alpha});
  shares_.insert(shares_.end(), shares.begin(), shares.end());
}

DeepImage applyPlan(const DeepImage& source, const Box& window, std::span<const RowPlan> rows) {
  DeepImage result{window, source.displayWindow, Buffer<uint64_t>(window.area() + 1), {}, source.attributes};
  const size_t width = size_t(window.width());
  std::vector<uint64_t> begins{0};
  for (const RowPlan& row : rows) begins.push_back(begins.back() + row.samples());
  result.offsets[window.area()] = begins.back();
  for (const Channel& channel : source.channels) result.add(channel.name, channel.type);
  parallelFor(0, int(rows.size()), [&](int y) {
    const RowPlan& row = rows[size_t(y)];
    const uint64_t begin = begins[size_t(y)];
    for (size_t x = 0; x < width; ++x) result.offsets[size_t(y) * width + x] = begin + row.first(x);
    for (size_t c = 0; c < source.channels.size(); ++c)
      fillRow(row, source.channels[c], size_t(begin), result.channels[c]);
  });
  return result;
}

}  // namespace fathom::deep
