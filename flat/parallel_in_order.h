// Things made in parallel and taken in order.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "flat/parallel.h"

#ifndef __SANITIZE_THREAD__
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>
#endif

namespace fathom {

// Calls take(i, make(i)) for every index in [begin, end): `make` from many threads at once, `take` in ascending order, one
// call at a time. Few results wait at any moment. After an exception, which is thrown on, nothing more is taken.
template <class Make, class Take>
void parallelInOrder(size_t begin, size_t end, const Make& make, const Take& take) {
  using Made = decltype(make(begin));
#ifdef __SANITIZE_THREAD__
  // See flat/parallel.h.
  constexpr size_t kBatch = 16;
  for (size_t first = begin; first < end; first += kBatch) {
    std::vector<Made> batch(std::min(kBatch, end - first));
    parallelFor(0, int(batch.size()), [&](int i) { batch[size_t(i)] = make(first + size_t(i)); });
    for (size_t i = 0; i < batch.size(); ++i) take(first + i, batch[i]);
  }
#else
  using Numbered = std::pair<size_t, Made>;
  size_t next = begin;
  const auto number = [&](tbb::flow_control& control) {
    if (next < end) return next++;
    control.stop();
    return end;
  };
  tbb::parallel_pipeline(
      2 * size_t(tbb::this_task_arena::max_concurrency()),
      tbb::make_filter<void, size_t>(tbb::filter_mode::serial_in_order, number) &
          tbb::make_filter<size_t, Numbered>(tbb::filter_mode::parallel,
                                             [&](size_t i) { return Numbered(i, make(i)); }) &
          tbb::make_filter<Numbered, void>(tbb::filter_mode::serial_in_order,
                                           [&](const Numbered& made) { take(made.first, made.second); }));
#endif
}

}  // namespace fathom
