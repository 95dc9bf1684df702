// Things made in parallel and taken in order.
#pragma once

#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "base/parallel.h"

#ifndef __SANITIZE_THREAD__
#include <tbb/parallel_pipeline.h>
#endif

namespace fathom {

// For every index in [begin, end): fetch(i), one call at a time in ascending order; make(i, what was fetched), from many
// threads at once; take(i, what was made), in ascending order, one call at a time. At most `most` indices are under way
// at any moment. After an exception, which is thrown on, nothing more is taken.
template <class Fetch, class Make, class Take>
void parallelPipeline(size_t begin, size_t end, size_t most, const Fetch& fetch, const Make& make, const Take& take) {
  using Fetched = decltype(fetch(begin));
  using Made = decltype(make(begin, std::declval<Fetched>()));
#ifdef __SANITIZE_THREAD__
  // See base/parallel.h.
  for (size_t first = begin; first < end; first += most) {
    std::vector<std::optional<Fetched>> fetched(std::min(most, end - first));
    std::vector<std::optional<Made>> made(fetched.size());
    for (size_t i = 0; i < fetched.size(); ++i) fetched[i].emplace(fetch(first + i));
    parallelFor(0, int(made.size()),
                [&](int i) { made[size_t(i)].emplace(make(first + size_t(i), std::move(*fetched[size_t(i)]))); });
    for (size_t i = 0; i < made.size(); ++i) take(first + i, std::move(*made[i]));
  }
#else
  // Only indices go between filters: oneTBB copies what does, and does not destroy what is on the way when one throws. Those
  // under way follow one another, as the last filter takes them in order.
  struct Slot {
    std::optional<Fetched> fetched;
    std::optional<Made> made;
  };
  std::vector<Slot> slots(most);
  const auto slot = [&](size_t i) -> Slot& { return slots[i % most]; };
  size_t next = begin;
  const auto first = [&](tbb::flow_control& control) -> size_t {
    if (next >= end) {
      control.stop();
      return 0;
    }
    slot(next).fetched.emplace(fetch(next));
    return next++;
  };
  const auto second = [&](size_t i) {
    slot(i).made.emplace(make(i, std::move(*slot(i).fetched)));
    slot(i).fetched.reset();
    return i;
  };
  const auto third = [&](size_t i) {
    take(i, std::move(*slot(i).made));
    slot(i).made.reset();
  };
  tbb::parallel_pipeline(most, tbb::make_filter<void, size_t>(tbb::filter_mode::serial_in_order, first) &
                                   tbb::make_filter<size_t, size_t>(tbb::filter_mode::parallel, second) &
                                   tbb::make_filter<size_t, void>(tbb::filter_mode::serial_in_order, third));
#endif
}

// Calls take(i, make(i)) for every index in [begin, end): `make` from many threads at once, `take` in ascending order,
// one call at a time. Few results wait at any moment. After an exception, which is thrown on, nothing more is taken.
template <class Make, class Take>
void parallelInOrder(size_t begin, size_t end, const Make& make, const Take& take) {
  const size_t most = 2 * size_t(tbb::this_task_arena::max_concurrency());
  parallelPipeline(
      begin, end, most, [](size_t i) { return i; }, [&](size_t i, size_t) { return make(i); }, take);
}

}  // namespace fathom
