#include "deep/filter_passes.h"

#include <algorithm>

namespace fathom::deep {

namespace {

JointFilterParams commonParams(const DenoisePlan& plan) {
  JointFilterParams params;
  params.epsilon *= 4 * plan.level * plan.level;
  params.crossed = plan.inputs.halves;
  return params;
}

std::vector<FilterPass> ownPasses(const DenoisePlan& plan) {
  JointFilterParams first = commonParams(plan);
  first.kColour = {0.45f, 0.7f};
  first.kFeature = {0.7f, 2.0f, 0.7f};
  if (plan.params.quality == Quality::Fast) {
    first.radius = 3;
    first.patchRadius = 1;
    first.candidates = 2;
    first.colourCandidates = 1;
    first.kColour = {0.6f, 0.6f};
    first.kFeature = {1.0f, 0.7f, 0.7f};
  }
  if (plan.params.quality != Quality::Best || !plan.inputs.halves) return {{{first}, {}}};
  JointFilterParams second = first;
  second.radius = 6;
  second.patchRadius = 2;
  second.kColour = {1.0f, 2.0f};
  second.tau = 0.0007f;
  return {{{first}, {}}, {{second}, {}}};
}

std::vector<FilterPass> paperPasses(const DenoisePlan& plan) {
  JointFilterParams bank = commonParams(plan);
  bank.radius = 4;
  bank.patchRadius = 1;
  bank.kColour = {0.45f, 0.6f};
  bank.kFeature = {0.7f, 2.0f, 2.0f};
  bank.tau = 0.001f;
  return {{{bank}, {.error = ErrorEstimate::OtherHalf, .best = true}}};
}

std::vector<FilterPass> rdfcPasses(const DenoisePlan& plan) {
  JointFilterParams first = commonParams(plan);
  first.radius = 10;
  first.patchRadius = 1;
  first.candidates = first.colourCandidates = 1;
  first.kColour = {0.45f, 0.45f};
  first.kFeature = {0.6f, 0.6f, 0.6f};
  first.tau = 0.001f;
  JointFilterParams second = first;
  second.patchRadius = 3;
  JointFilterParams third = first;
  third.colourCandidates = 0;
  third.tau = 0.0001f;
  const SelectionParams selection{.error = ErrorEstimate::Stein, .best = true};
  if (!plan.inputs.halves) return {{{first, second, third}, selection}};
  JointFilterParams again = first;
  again.kColour = {1.0f, 1.0f};
  again.tau = 0.0001f;
  return {{{first, second, third}, selection}, {{again}, selection}};
}

}  // namespace

int FilterPass::candidates() const {
  int sum = 0;
  for (const JointFilterParams& bank : banks) sum += bank.candidates;
  return sum;
}

int FilterPass::radius() const {
  int largest = 0;
  for (const JointFilterParams& bank : banks) largest = std::max(largest, bank.radius);
  return largest;
}

int FilterPass::guideBorder() const {
  int largest = 0;
  for (const JointFilterParams& bank : banks) largest = std::max(largest, bank.radius + bank.patchRadius);
  return largest;
}

std::vector<FilterPass> filterPasses(const DenoisePlan& plan) {
  switch (plan.params.filter) {
    case FilterKind::Paper:
      return paperPasses(plan);
    case FilterKind::Rdfc:
      return rdfcPasses(plan);
    case FilterKind::Own:
      break;
  }
  return ownPasses(plan);
}

}  // namespace fathom::deep
