#include "deep/ops/sample_plan.h"

#include <algorithm>

#include "deep/channels.h"
#include "flat/limited.h"

namespace fathom::deep {

namespace {

// The share with the largest part, the first where several have it.
const RowPlan::Share& largest(std::span<const RowPlan::Share> shares) {
  return *std::max_element(shares.begin(), shares.end(), [](const auto& a, const auto& b) { return a.part < b.part; });
}

// The values of what is made of `shares`, weighted by `factor`.
float mixed(std::span<const RowPlan::Share> shares, float RowPlan::Share::*factor, const Buffer<float>& values) {
  double sum = 0;
  for (const RowPlan::Share& share : shares) sum += double(share.*factor) * double(finiteOrZero(values[share.sample]));
  return limited(sum);
}

// Fills a row of a channel: what is kept from its source, and valueOf(i) for the i-th one made.
template <class T, class ValueOf>
void fill(const RowPlan& row, const Buffer<T>& from, T* to, const ValueOf& valueOf) {
  for (const RowPlan::Run& run : row.kept()) std::copy_n(from.data() + run.from, run.count, to + run.at);
  for (size_t i = 0; i < row.made().size(); ++i) to[row.made()[i].at] = valueOf(i);
}

void fillRow(const RowPlan& row, const Channel& from, size_t at, Channel& to) {
  const auto ofLargest = [&](size_t i, const auto& values) {
    return row.shares(i).empty() ? 0 : values[largest(row.shares(i)).sample];
  };
  const auto fillValues = [&](const auto& valueOf) { fill(row, from.values, to.values.data() + at, valueOf); };
  switch (roleOf(from)) {
    case Role::Identifier:
      fill(row, from.ids, to.ids.data() + at, [&](size_t i) { return ofLargest(i, from.ids); });
      break;
    case Role::Statistic:
      fillValues([&](size_t i) { return ofLargest(i, from.values); });
      break;
    case Role::Depth:
      if (from.name == "ZBack")
        fillValues([&](size_t i) { return row.made()[i].zBack; });
      else
        fillValues([&](size_t i) { return row.made()[i].z; });
      break;
    case Role::Alpha:
      fillValues([&](size_t i) { return row.made()[i].alpha; });
      break;
    case Role::Plain:
      fillValues([&](size_t i) { return mixed(row.shares(i), &RowPlan::Share::part, from.values); });
      break;
    default:
      fillValues([&](size_t i) { return mixed(row.shares(i), &RowPlan::Share::weight, from.values); });
  }
}

}  // namespace

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
    for (size_t x = 0; x < width; ++x)
      result.offsets[size_t(y) * width + x] = begin + (x < row.firsts().size() ? row.firsts()[x] : row.samples());
    for (size_t c = 0; c < source.channels.size(); ++c)
      fillRow(row, source.channels[c], size_t(begin), result.channels[c]);
  });
  return result;
}

}  // namespace fathom::deep
