#include "deep/layer_inputs.h"

#include <algorithm>

namespace fathom::deep {

namespace {

bool has(std::span<const std::string> channels, const std::string& prefix, const char* letters = "RGB") {
  return std::ranges::all_of(std::string(letters), [&](char letter) {
    return std::ranges::find(channels, prefix + letter) != channels.end();
  });
}

}  // namespace

LayerInputs findLayerInputs(std::span<const std::string> channels, const Attributes& attributes) {
  const auto given = [&](const char* name) { return std::ranges::find(channels, name) != channels.end(); };
  return {.components = has(channels, "diffuse.") && has(channels, "specular."),
          .albedo = has(channels, "albedo."),
          .normal = has(channels, "N.", "XYZ"),
          .coc = given("coc"),
          .lens = given("lens.U") && given("lens.V"),
          .diffuseVariance = has(channels, "variance.diffuse."),
          .specularVariance = has(channels, "variance.specular."),
          .variance = has(channels, "variance."),
          .counts = given("samples"),
          .spp = std::max(attributes.getInt("fathom:spp").value_or(0), 0)};
}

std::vector<std::string> describeMissing(const LayerInputs& inputs) {
  std::vector<std::string> lines;
  if (!inputs.components) lines.emplace_back("no diffuse.* and specular.*: all light is taken for one kind");
  if (!inputs.albedo && !inputs.normal)
    lines.emplace_back("no albedo.* or N.*: the network has less to go by");
  else if (!inputs.albedo || !inputs.normal)
    lines.emplace_back(inputs.albedo ? "no N.*: the network has less to go by"
                                     : "no albedo.*: the network has less to go by");
  if (!inputs.counts && inputs.spp <= 0)
    lines.emplace_back("no samples and no fathom:spp: each deep sample is taken for one camera sample");
  return lines;
}

bool layersRead(const LayerInputs& inputs, const std::string& channel) {
  const auto of = [&](const char* prefix) { return channel.starts_with(prefix); };
  if (channel == "A" || channel == "Z" || channel == "ZBack") return true;
  if (channel.size() == 1) return !inputs.components;
  if (of("variance.diffuse.")) return inputs.diffuseVariance;
  if (of("variance.specular.")) return inputs.specularVariance;
  if (of("variance.")) return channel.size() == 10 && inputs.variance && !inputs.specularVariance;
  return of("diffuse.") || of("specular.") || of("albedo.") || of("N.") || channel == "coc" || of("lens.") ||
         channel == "samples";
}

}  // namespace fathom::deep
