#include "cli/compare_report.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

namespace fathom::cli {

using nlohmann::ordered_json;

namespace {

// JSON knows no infinity.
ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

ordered_json binsToJson(const deep::BinMetrics& m) {
  ordered_json result = {{"relMSE", number(m.relMse)},
                         {"MSE", number(m.mse)},
                         {"bins", m.bins},
                         {"excluded", m.excluded},
                         {"leftOut", number(m.leftOut)}};
  if (m.ownRelMse) result["ownRelMSE"] = number(*m.ownRelMse);
  return result;
}

ordered_json clipToJson(const deep::ClipMetrics& m) {
  return {{"depth", m.depth},
          {"front", m.front ? toJson(*m.front) : ordered_json(nullptr)},
          {"behind", m.behind ? toJson(*m.behind) : ordered_json(nullptr)}};
}

void printRow(const std::string& part, const ordered_json& measures) {
  fmt::print("{:<22}", part);
  for (const char* name : {"relMSE", "relMSETrimmed", "MSE", "PSNR", "SMAPE", "SSIM"}) {
    const int width = name == std::string("relMSETrimmed") ? 14 : 11;
    if (!measures.contains(name)) {
      fmt::print("{:>{}}", "-", width);
    } else if (measures[name].is_null()) {
      fmt::print("{:>{}}", "inf", width);
    } else {
      fmt::print("{:>{}.{}f}", measures[name].get<double>(), width, name == std::string("PSNR") ? 2 : 5);
    }
  }
  fmt::print("\n");
}

}  // namespace

ordered_json toJson(const flat::Metrics& m) {
  ordered_json result = {{"relMSE", number(m.relMse)}, {"relMSETrimmed", number(m.relMseTrimmed)},
                         {"MSE", number(m.mse)},       {"PSNR", number(m.psnr)},
                         {"SMAPE", number(m.smape)},   {"SSIM", number(m.ssim)},
                         {"pixels", m.pixels},         {"excluded", m.excluded}};
  if (m.ownRelMse) result["ownRelMSE"] = number(*m.ownRelMse);
  return result;
}

ordered_json toJson(const deep::DeepMetrics& m) {
  ordered_json result = {
      {"flattened", toJson(m.flattened)}, {"bins", binsToJson(m.bins)}, {"clips", ordered_json::array()}};
  for (const deep::ClipMetrics& clip : m.clips) result["clips"].push_back(clipToJson(clip));
  return result;
}

ordered_json meanOf(const std::vector<ordered_json>& values) {
  ordered_json result = values.front();
  for (const ordered_json& value : values)
    if (!value.is_number() && !value.is_structured()) return nullptr;
  if (result.is_number()) {
    double sum = 0;
    for (const ordered_json& value : values) sum += value.get<double>();
    return sum / double(values.size());
  }
  for (auto it = result.begin(); it != result.end(); ++it) {
    std::vector<ordered_json> parts;
    for (const ordered_json& value : values)
      parts.push_back(result.is_array() ? value.at(size_t(it - result.begin()))
                                        : value.value(it.key(), ordered_json()));
    *it = meanOf(parts);
  }
  return result;
}

void printTable(const ordered_json& frame) {
  fmt::print("{:<22}{:>11}{:>14}{:>11}{:>11}{:>11}{:>11}\n", "", "relMSE", "without worst", "MSE", "PSNR", "SMAPE",
             "SSIM");
  printRow("flattened", frame["flattened"]);
  if (frame.contains("bins")) printRow("per bin", frame["bins"]);
  for (const ordered_json& clip : frame.value("clips", ordered_json::array())) {
    const double depth = clip["depth"].get<double>();
    if (!clip["front"].is_null()) printRow(fmt::format("in front of {:.4g}", depth), clip["front"]);
    if (!clip["behind"].is_null()) printRow(fmt::format("behind {:.4g}", depth), clip["behind"]);
  }
}

void printNotes(const ordered_json& frame, bool corrected) {
  const ordered_json& flat = frame["flattened"];
  if (flat.contains("ownRelMSE"))
    fmt::print("The reference's own error, relMSE {:.5f} flattened, is {}.\n", flat["ownRelMSE"].get<double>(),
               corrected ? "subtracted from relMSE and MSE" : "part of these; --correct subtracts it");
  if (flat["excluded"].get<double>() > 0)
    fmt::print("{} pixels are not finite on one side; they are left out.\n", flat["excluded"].get<double>());
  if (!frame.contains("bins")) return;
  if (frame["bins"]["excluded"].get<double>() > 0)
    fmt::print("{} bins are not finite on one side; they are left out per bin.\n",
               frame["bins"]["excluded"].get<double>());
  if (frame["bins"]["leftOut"].get<double>() > 0)
    fmt::print(
        "{:.2g} % of the alpha is in bins that fewer than 16 reference samples saw; they are left out per bin.\n",
        100 * frame["bins"]["leftOut"].get<double>());
}

}  // namespace fathom::cli
