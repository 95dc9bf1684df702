// The stand-in for oneTBB's parallel loop in builds for ThreadSanitizer, which sees all of what std::thread does.
#pragma once

#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace fathom {

// Calls body(i) for every index in [begin, end), from four threads; the first exception ends the loop and is thrown on.
template <class Body>
void forEachOnThreads(int begin, int end, const Body& body) {
  std::atomic<int> next = begin;
  std::exception_ptr error;
  std::mutex guard;
  const auto work = [&] {
    try {
      for (int i = next++; i < end; i = next++) body(i);
    } catch (...) {
      next = end;
      const std::lock_guard lock(guard);
      if (!error) error = std::current_exception();
    }
  };
  std::vector<std::jthread> threads;
  for (int i = 0; i < 3 && end - begin > i + 1; ++i) threads.emplace_back(work);
  work();
  threads.clear();
  if (error) std::rethrow_exception(error);
}

}  // namespace fathom
