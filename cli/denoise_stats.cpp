#include "cli/denoise_stats.h"

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "cli/peak_memory.h"

namespace fathom::cli {

namespace {

const char* nameOf(FrameReport::Status status) {
  switch (status) {
    case FrameReport::Status::Done:
      return "done";
    case FrameReport::Status::Kept:
      return "kept";
    case FrameReport::Status::Elsewhere:
      return "elsewhere";
    default:
      return "failed";
  }
}

}  // namespace

void writeStats(const std::string& path, const std::vector<DenoiseFrame>& frames,
                const std::vector<FrameReport>& reports, double planSeconds) {
  using Json = nlohmann::ordered_json;
  Json list = Json::array();
  deep::DenoiseStats total;
  total.seconds["plan"] = planSeconds;
  std::map<std::string, int> statuses = {{"done", 0}, {"kept", 0}, {"elsewhere", 0}, {"failed", 0}};
  for (size_t i = 0; i < reports.size(); ++i) {
    const FrameReport& report = reports[i];
    const char* status = nameOf(report.status);
    ++statuses[status];
    Json frame = {
        {"input", frames[i].inputs.main}, {"output", frames[i].outputs.image}, {"status", status},
        {"bands", report.bands},          {"seconds", report.stats.seconds},   {"counts", report.stats.counts}};
    if (!report.error.empty()) frame["error"] = report.error;
    list.push_back(std::move(frame));
    for (const auto& [stage, seconds] : report.stats.seconds) total.seconds[stage] += seconds;
    for (const auto& [what, count] : report.stats.counts) total.counts[what] += count;
  }
  const Json root = {{"version", FATHOM_VERSION},
                     {"frames", std::move(list)},
                     {"total", {{"frames", statuses}, {"seconds", total.seconds}, {"counts", total.counts}}},
                     {"peakMemory", peakMemory()}};
  std::ofstream file(path);
  // File names may hold any bytes; JSON holds text.
  file << root.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  if (!file.flush()) fail("{}: expected a file that can be written", path);
}

}  // namespace fathom::cli
