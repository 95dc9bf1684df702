// What every benchmark needs: interleaved timings, peak memory, and a table that is printed and kept as JSON.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace fathom::bench {

// Seconds as they pass, or those that the process has of the processors, which others do not disturb as much.
enum class Clock { wall, cpu };

// Runs every case once unmeasured, then all of them in turn `repeats` times, so that a slow moment of the machine
// falls on all alike; returns the median seconds of each.
std::vector<double> interleavedMedians(const std::vector<std::function<void()>>& cases, int repeats,
                                       Clock clock = Clock::wall);

double median(std::vector<double> values);

// Of positive values; what is below 1e-9 counts as that. NaN where there is none.
double geometricMean(const std::vector<double>& values);

// How many bytes the process grew by at most while `work` ran (resident set; Linux keeps its peak).
size_t peakGrowth(const std::function<void()>& work);

// A word or a number; numbers are printed with three significant digits.
class Cell {
 public:
  Cell(std::string word) : word_(std::move(word)) {}
  Cell(const char* word) : word_(word) {}
  Cell(double number) : number_(number) {}

  std::string text() const;
  const std::optional<double>& number() const { return number_; }

 private:
  std::string word_;
  std::optional<double> number_;
};

// Columns carry their unit in their name ("s/MP").
class Table {
 public:
  Table(std::string title, std::vector<std::string> columns) : title_(std::move(title)), columns_(std::move(columns)) {}

  void add(std::vector<Cell> row) { rows_.push_back(std::move(row)); }
  void print() const;

  const std::string& title() const { return title_; }
  const std::vector<std::string>& columns() const { return columns_; }
  const std::vector<std::vector<Cell>>& rows() const { return rows_; }

 private:
  std::string title_;
  std::vector<std::string> columns_;
  std::vector<std::vector<Cell>> rows_;
};

// The title as a heading and the rows as Markdown; columns are as wide as they need to be.
std::string markdownOf(const Table& table);
// A line for the columns and one a row; numbers in full; words in quotes where they have a comma, a quote or a line's end in
// them.
std::string csvOf(const Table& table);

void writeText(const std::string& path, const std::string& text);

// All tables of a benchmark: {"title": [{"column": value, ...}, ...], ...}.
void writeJson(const std::string& path, const std::vector<Table>& tables);

}  // namespace fathom::bench
