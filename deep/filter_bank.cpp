#include "deep/filter_bank.h"

#include <algorithm>
#include <mutex>

namespace fathom::deep {

namespace {

// Sums what the tiles of one bank did, from several threads, and tells how far they are.
class TileCount {
 public:
  TileCount(const DenoiseData& data, const Progress& progress, double from, double to, FilterCounts& counts)
      : data_(data), progress_(progress), from_(from), to_(to), counts_(counts) {}

  void add(const FilterTile& tile) {
    const uint64_t bins = binsOf(tile.box);
    const size_t components = data_.components.size();
    const std::lock_guard lock(mutex_);
    ++counts_.tiles;
    if (tile.active == 0)
      ++counts_.tilesStill;
    else
      counts_.tilesDark += components - size_t(tile.components);
    const size_t filtered = tile.active == 0 ? 0 : size_t(tile.components);
    counts_.binsFiltered += bins * filtered;
    counts_.binsSkipped += bins * (components - filtered);
    done_ += double(tile.box.area()) / (double(data_.width) * double(data_.height));
    progress_.at(from_ + (to_ - from_) * std::min(1.0, done_));
  }

 private:
  uint64_t binsOf(const Box& box) const {
    uint64_t bins = 0;
    for (int y = box.y0; y < box.y1; ++y) {
      const uint64_t* row = data_.offsets + size_t(y) * size_t(data_.width);
      bins += row[box.x1] - row[box.x0];
    }
    return bins;
  }

  const DenoiseData& data_;
  const Progress& progress_;
  double from_, to_, done_ = 0;
  std::mutex mutex_;
  FilterCounts& counts_;
};

// The features of a frame as the joint filter takes them; owns their gradients.
struct FeatureInput {
  std::vector<Buffer<float>> gradients;
  std::vector<FeatureChannel> channels;

  FeatureInput(const DenoiseData& data, const Buffer<uint8_t>& still) {
    for (const Feature* feature : {&data.albedo, &data.normal, &data.depth}) {
      std::vector<Buffer<float>> gradient = squaredGradients(data, *feature, still);
      for (size_t c = 0; c < gradient.size(); ++c) {
        channels.push_back({feature->value[c].data(), feature->variance[c].data(), gradient[c].data()});
        gradients.push_back(std::move(gradient[c]));
      }
    }
  }
};

// The candidates of one bank for every component, from `first` on.
void filterBank(const DenoiseData& data, const FeatureInput& features, std::span<const ComponentGuide> guides,
                const Activity& activity, const JointFilterParams& bank, int radius, int first,
                std::vector<Candidates>& candidates, TileCount& count) {
  JointFilterInput input{data.width,        data.height, data.rowPhase,        data.offsets,
                         features.channels, {},          activity.still.data()};
  for (size_t c = 0; c < data.components.size(); ++c) {
    const ComponentGuide& guide = guides[c];
    input.components.push_back(
        {data.components[c].data.data(), {&guide.value[0], &guide.value[1]}, {&guide.variance, &guide.variance}});
  }
  const auto active = [&](const Box& tile) { return activeComponents(data, activity, tile, radius); };
  const auto consume = [&](const FilterTile& tile) {
    int c = 0;
    for (size_t i = 0; i < data.components.size(); ++i) {
      if (tile.active >> i & 1)
        addCandidates(data, data.components[i], guides[i].variance, tile, c++, first, activity.still, candidates[i]);
      else if (activeNear(data, activity, tile.box, 0))
        addDarkness(data, tile.box, candidates[i]);
    }
    count.add(tile);
  };
  jointFilter(input, bank, active, consume);
}

// In candidate pixels of the windows.
double costOf(const JointFilterParams& bank) {
  return double(2 * bank.radius + 1) * (2 * bank.radius + 1);
}

double costOf(const FilterPass& pass) {
  double cost = 0;
  for (const JointFilterParams& bank : pass.banks) cost += costOf(bank);
  return cost;
}

// One pass: all candidates for every component, blended; with pilots where pilotPad > 0, with answers where wanted.
// `done` and `cost`: of the banks before it, and of all.
std::vector<Blend> filterOnce(const DenoiseData& data, const FeatureInput& features,
                              std::span<const ComponentGuide> guides, const Activity& activity, const FilterPass& pass,
                              float level, int pilotPad, bool answers, double done, double cost,
                              const Progress& progress, FilterCounts& counts) {
  std::vector<Candidates> candidates;
  for (size_t c = 0; c < data.components.size(); ++c)
    candidates.emplace_back(data, pass.candidates(), pass.selection, Wanted{pilotPad > 0, answers});
  int first = 0;
  for (const JointFilterParams& bank : pass.banks) {
    const double from = done / cost;
    done += costOf(bank);
    TileCount count(data, progress, from, done / cost, counts);
    filterBank(data, features, guides, activity, bank, pass.radius(), first, candidates, count);
    first += bank.candidates;
  }
  std::vector<Blend> result;
  for (Candidates& candidate : candidates)
    result.push_back(blendCandidates(data, activity.still, std::move(candidate), level, pilotPad));
  return result;
}

// Still pixels are not filtered: their guides stay.
void copyStill(const DenoiseData& data, const Buffer<uint8_t>& still, const ComponentGuide& from, ComponentGuide& to) {
  const auto copy = [&](const flat::Padded& source, flat::Padded& target) {
    for (int y = 0; y < data.height; ++y)
      for (int x = 0; x < data.width; ++x)
        if (still[size_t(y) * size_t(data.width) + size_t(x)]) target.row(y)[x] = source.row(y)[x];
    target.extend();
  };
  for (size_t c = 0; c < 3; ++c) {
    for (size_t h = 0; h < 2; ++h) copy(from.value[h].value[c], to.value[h].value[c]);
    copy(from.variance.value[c], to.variance.value[c]);
  }
}

// Adds to the sums of `before` passes' values, by component. A bin for which a pass found nothing takes the mean of
// those before it.
void addPass(std::vector<Blend>& blends, size_t before, std::vector<Buffer<float>>& sums) {
  for (size_t c = 0; c < blends.size(); ++c) {
    if (sums.size() <= c) {
      sums.push_back(std::move(blends[c].value));
      continue;
    }
    const Blend& blend = blends[c];
    for (size_t i = 0; i < sums[c].size(); ++i)
      sums[c][i] += blend.known[i / 3] ? blend.value[i] : sums[c][i] / float(before);
  }
}

// Takes the answers into the means of those of `before` passes, as addPass does with what was found.
void addAnswers(std::vector<Blend>& blends, size_t before, std::vector<HalfAnswer>& means) {
  for (size_t c = 0; c < blends.size(); ++c) {
    if (before == 0) {
      means.push_back(std::move(blends[c].answer));
      continue;
    }
    const auto add = [&](const Buffer<float>& from, Buffer<float>& to) {
      for (size_t i = 0; i < to.size(); ++i)
        if (blends[c].known[i]) to[i] += (from[i] - to[i]) / float(before + 1);
    };
    for (size_t i = 0; i < 3; ++i) add(blends[c].answer.difference[i], means[c].difference[i]);
    for (size_t h = 0; h < 2; ++h) add(blends[c].answer.share[h], means[c].share[h]);
  }
}

}  // namespace

std::vector<Buffer<float>> filterColours(const DenoiseData& data, std::vector<ComponentGuide> guides,
                                         const Activity& activity, std::span<const FilterPass> passes, float level,
                                         const Progress& progress, FilterCounts& counts,
                                         std::vector<HalfAnswer>* answers) {
  const FeatureInput features(data, activity.still);
  std::vector<Buffer<float>> result;
  double cost = 0, done = 0;
  for (const FilterPass& pass : passes) cost += costOf(pass);
  for (size_t i = 0; i < passes.size(); ++i) {
    const int pilotPad = i + 1 < passes.size() ? passes[i + 1].guideBorder() : 0;
    std::vector<Blend> blends =
        filterOnce(data, features, guides, activity, passes[i], level, pilotPad, answers, done, cost, progress, counts);
    done += costOf(passes[i]);
    for (size_t c = 0; c < guides.size() && pilotPad > 0; ++c) {
      copyStill(data, activity.still, guides[c], blends[c].pilot);
      guides[c] = std::move(blends[c].pilot);
    }
    if (answers) addAnswers(blends, i, *answers);
    addPass(blends, i, result);
  }
  for (size_t c = 0; c < result.size() && passes.size() > 1; ++c)
    for (float& value : result[c]) value /= float(passes.size());
  return result;
}

}  // namespace fathom::deep
