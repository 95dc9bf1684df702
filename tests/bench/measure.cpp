#include "tests/bench/measure.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace fathom::bench {
namespace {

double secondsOf(const std::function<void()>& work, Clock clock) {
  if (clock == Clock::cpu) {
    const std::clock_t start = std::clock();
    work();
    return double(std::clock() - start) / CLOCKS_PER_SEC;
  }
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// A line of /proc/self/status, in bytes.
size_t statusBytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    size_t kilobytes = 0;
    if (word == key && status >> kilobytes) return kilobytes * 1024;
  }
  fail("/proc/self/status: expected a line {}, found none", key);
}

}  // namespace

std::string Cell::text() const {
  return number_ ? fmt::format("{:.3g}", *number_) : word_;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

double geometricMean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += std::log(std::max(value, 1e-9));
  return std::exp(sum / double(values.size()));
}

std::vector<double> interleavedMedians(const std::vector<std::function<void()>>& cases, int repeats, Clock clock) {
  std::vector<std::vector<double>> seconds(cases.size());
  for (const auto& run : cases) run();
  for (int repeat = 0; repeat < repeats; ++repeat)
    for (size_t i = 0; i < cases.size(); ++i) seconds[i].push_back(secondsOf(cases[i], clock));
  std::vector<double> medians;
  for (const auto& of : seconds) medians.push_back(median(of));
  return medians;
}

size_t peakGrowth(const std::function<void()>& work) {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";  // the kernel starts the peak anew
  const size_t before = statusBytes("VmRSS:");
  work();
  return std::max(statusBytes("VmHWM:"), before) - before;
}

std::string markdownOf(const Table& table) {
  std::vector<size_t> widths;
  for (size_t c = 0; c < table.columns().size(); ++c) {
    widths.push_back(table.columns()[c].size());
    for (const auto& row : table.rows()) widths[c] = std::max(widths[c], row[c].text().size());
  }
  std::string text = fmt::format("\n{}\n\n", table.title());
  const auto line = [&](auto&& cell) {
    for (size_t c = 0; c < widths.size(); ++c)
      text += fmt::format("{}{:<{}}", c == 0 ? "| " : " | ", cell(c), widths[c]);
    text += " |\n";
  };
  line([&](size_t c) { return table.columns()[c]; });
  line([&](size_t c) { return std::string(widths[c], '-'); });
  for (const auto& row : table.rows()) line([&](size_t c) { return row[c].text(); });
  return text;
}

std::string csvOf(const Table& table) {
  const auto quoted = [](const std::string& word) {
    if (word.find_first_of(",\"\n") == std::string::npos) return word;
    std::string result = "\"";
    for (const char c : word) result.append(c == '"' ? 2 : 1, c);
    result += '"';
    return result;
  };
  std::string text;
  const auto line = [&](size_t cells, auto&& cell) {
    for (size_t c = 0; c < cells; ++c) text.append(c == 0 ? "" : ",").append(cell(c));
    text += '\n';
  };
  line(table.columns().size(), [&](size_t c) { return quoted(table.columns()[c]); });
  for (const auto& row : table.rows())
    line(row.size(),
         [&](size_t c) { return row[c].number() ? fmt::format("{}", *row[c].number()) : quoted(row[c].text()); });
  return text;
}

void Table::print() const {
  fmt::print("{}", markdownOf(*this));
  std::fflush(stdout);
}

void writeText(const std::string& path, const std::string& text) {
  if (const auto folder = std::filesystem::path(path).parent_path(); !folder.empty())
    std::filesystem::create_directories(folder);
  std::ofstream out(path);
  out << text;
  if (!out.flush()) fail("{}: cannot be written", path);
}

void writeJson(const std::string& path, const std::vector<Table>& tables) {
  nlohmann::ordered_json json;
  for (const Table& table : tables) {
    auto& rows = json[table.title()] = nlohmann::ordered_json::array();
    for (const auto& row : table.rows()) {
      nlohmann::ordered_json object;
      for (size_t c = 0; c < row.size(); ++c)
        if (auto& value = object[table.columns()[c]]; row[c].number())
          value = *row[c].number();
        else
          value = row[c].text();
      rows.push_back(std::move(object));
    }
  }
  writeText(path, json.dump(2) + '\n');
}

}  // namespace fathom::bench
