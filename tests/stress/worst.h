// The worst error of an operation under each kind of stress, held to a bound and left for the table.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "tests/stress/record.h"

namespace fathom::stress {

class Worst {
 public:
  // `bound` is what no error may be above; the test says why it is that.
  Worst(std::string operation, double bound) : operation_(std::move(operation)), bound_(bound) {}
  Worst(const Worst&) = delete;
  Worst& operator=(const Worst&) = delete;
  ~Worst() {
    for (const auto& [stress, found] : worst_) {
      record(operation_, stress, found.error, bound_);
      EXPECT_LE(found.error, bound_) << operation_ << ", " << stress << ": seed " << found.seed << ", pixel "
                                     << found.pixel << ": expected " << found.expected << ", found " << found.value;
    }
  }

  // The error of `found` in units of `scale`; where it is no number, it is infinite.
  void put(const std::string& stress, unsigned seed, size_t pixel, long double found, long double expected,
           long double scale = 1) {
    const long double difference = std::abs(found - expected);
    const double error = std::isfinite(found) ? double(difference / scale) : HUGE_VAL;
    const auto [entry, isNew] = worst_.try_emplace(stress);
    if (isNew || error > entry->second.error) entry->second = {error, seed, pixel, double(expected), double(found)};
  }
  // That a frame without anything to compare was there.
  void touch(const std::string& stress) { worst_.try_emplace(stress); }

 private:
  struct Found {
    double error = 0;
    unsigned seed = 0;
    size_t pixel = 0;
    double expected = 0, value = 0;
  };
  std::string operation_;
  double bound_;
  std::map<std::string, Found> worst_;
};

}  // namespace fathom::stress
