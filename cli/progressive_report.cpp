#include "cli/progressive_report.h"

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace fathom::cli {

namespace {

using Json = nlohmann::ordered_json;

Json tilesOf(const PassReport& report, std::optional<double> target) {
  Json tiles = Json::array();
  for (const flat::TileError& tile : report.errors.tiles) {
    Json entry = {{"x", tile.window.x0},
                  {"y", tile.window.y0},
                  {"width", tile.window.width()},
                  {"height", tile.window.height()},
                  {"relMSE", tile.relMse}};
    if (target) entry["reached"] = tile.relMse <= *target;
    tiles.push_back(std::move(entry));
  }
  return tiles;
}

Json passOf(const PassReport& report, std::optional<double> target) {
  Json pass = {{"input", report.input}, {"output", report.output}};
  if (report.status == PassReport::Status::Failed) {
    pass["error"] = report.error;
    return pass;
  }
  pass["spp"] = report.spp > 0 ? Json(report.spp) : Json(nullptr);
  pass["relMSE"] = report.errors.relMse;
  pass["renderRelMSE"] = report.errors.render;
  if (target) pass["reached"] = reaches(report, target);
  pass["tiles"] = tilesOf(report, target);
  return pass;
}

}  // namespace

bool reaches(const PassReport& report, std::optional<double> target) {
  return target && report.status == PassReport::Status::Done && report.errors.relMse <= *target;
}

void writeProgressiveReport(const std::string& path, const std::vector<PassReport>& reports,
                            std::optional<double> target) {
  Json passes = Json::array();
  for (const PassReport& report : reports) passes.push_back(passOf(report, target));
  Json root = {{"version", FATHOM_VERSION}, {"tileSize", flat::kErrorTile}};
  if (target) {
    const auto first = std::ranges::find_if(reports, [&](const PassReport& report) { return reaches(report, target); });
    root["target"] = *target;
    root["stopAt"] = first == reports.end() ? Json(nullptr) : Json(first->input);
  }
  root["passes"] = std::move(passes);
  std::ofstream file(path);
  // File names may hold any bytes; JSON holds text.
  file << root.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  if (!file.flush()) fail("{}: expected a file that can be written", path);
}

}  // namespace fathom::cli
