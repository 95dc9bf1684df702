#include "deep/ops/expression.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/channels.h"
#include "deep/ops/formula.h"
#include "deep/ops/named_channels.h"
#include "deep/volume.h"

namespace fathom::deep {

namespace {

// The names that are no channels, in the order of their values.
constexpr std::array<const char*, 4> kPlaces{"x", "y", "i", "n"};

bool isPlace(const std::string& name) {
  return std::ranges::find(kPlaces, name) != kPlaces.end();
}

// What formulas read or set, by the number of their value: the places, then channels.
struct Variables {
  struct Use {
    Channel* channel;
    Role role;
    bool set;
  };
  std::vector<std::string> names{kPlaces.begin(), kPlaces.end()};
  std::vector<Use> channels;

  size_t find(const std::string& name) const { return size_t(std::ranges::find(names, name) - names.begin()); }
  void add(DeepImage& image, const std::string& name, bool set) {
    const size_t at = find(name);
    if (at < names.size()) {
      channels[at - kPlaces.size()].set |= set;
      return;
    }
    Channel& channel = *image.find(name);
    names.push_back(name);
    channels.push_back({&channel, roleOf(channel), set});
  }
};

bool isSet(const std::vector<Assignment>& assignments, std::string_view name) {
  return std::ranges::any_of(assignments, [&](const Assignment& a) { return a.target == name; });
}

// Throws where a formula has a name that is neither a place nor a channel, there or set before it.
void checkNames(const DeepImage& image, const std::vector<Assignment>& assignments) {
  std::vector<std::string> known(kPlaces.begin(), kPlaces.end());
  for (const Channel& channel : image.channels) known.push_back(channel.name);
  for (const Assignment& assignment : assignments) {
    if (isPlace(assignment.target)) fail("expected a channel to set, found {}", assignment.target);
    for (const std::string& name : namesIn(assignment)) {
      if (std::ranges::find(known, name) != known.end()) continue;
      std::string all;
      for (const std::string& one : known) all.append(1, ' ').append(printable(one));
      fail("expected a channel or a function at character {}, found {}; there are{}", placeOf(assignment, name), name,
           all);
    }
    known.push_back(assignment.target);
  }
}

void addMissing(DeepImage& image, const std::vector<Assignment>& assignments) {
  for (const Assignment& assignment : assignments)
    if (!image.find(assignment.target)) image.add(assignment.target, PixelType::Float).values.fill(0);
}

// Leaves out what the new values void.
void dropVoid(DeepImage& image, const std::vector<Assignment>& assignments) {
  std::vector<std::string> targets;
  for (const Assignment& assignment : assignments) targets.push_back(assignment.target);
  std::vector<std::string> voided = statisticsOf(image, targets);
  if (isSet(assignments, "A")) {
    for (const Channel& channel : image.channels)
      if (describesSamples(roleOf(channel)) && !isSet(assignments, channel.name)) voided.push_back(channel.name);
    image.attributes.erase("fathom:spp");
  }
  if (isSet(assignments, "Z") || isSet(assignments, "ZBack")) image.attributes.erase("deepImageState");
  for (const std::string& name : voided) image.erase(name);
}

Variables variablesOf(DeepImage& image, const std::vector<Assignment>& assignments, bool unpremultiplied) {
  Variables variables;
  for (const Assignment& assignment : assignments) {
    for (const std::string& name : namesIn(assignment))
      if (!isPlace(name)) variables.add(image, name, false);
    variables.add(image, assignment.target, true);
  }
  if (unpremultiplied && isSet(assignments, "A"))
    for (const Channel& channel : image.channels)
      if (roleOf(channel) == Role::Premultiplied) variables.add(image, channel.name, true);
  return variables;
}

bool isDivided(Role role) {
  return role == Role::Premultiplied || role == Role::Half;
}

double wholeNumber(double value) {
  constexpr double kMost = std::numeric_limits<uint32_t>::max();
  return value > 0 ? std::min(std::nearbyint(value), kMost) : 0;
}

float storable(double value, Role role) {
  if (role == Role::Depth) return float(value);
  return std::abs(value) <= double(kLargest) ? float(value) : 0;
}

// All formulas, of one thread, and what they read and write.
class Evaluator {
 public:
  Evaluator(const std::vector<Assignment>& assignments, const Variables& variables, bool unpremultiplied)
      : variables_(variables), unpremultiplied_(unpremultiplied), values_(variables.names.size()) {
    for (const Assignment& assignment : assignments) {
      const size_t target = variables.find(assignment.target);
      const bool whole = variables.channels[target - kPlaces.size()].role == Role::Identifier;
      steps_.push_back({Formula(assignment, variables.names, values_), target, whole});
    }
  }

  void setPlace(int x, int y, size_t count) { values_[0] = x, values_[1] = y, values_[3] = double(count); }
  // `alpha` is the channel.
  void run(size_t sample, size_t place, std::span<const float> alpha) {
    values_[2] = double(place);
    const double before = unpremultiplied_ ? opacity(alpha[sample]) : 0;
    load(sample, before);
    for (const Step& step : steps_) {
      const double value = step.formula.evaluate();
      values_[step.target] = step.whole ? wholeNumber(value) : value;
    }
    store(sample, before, alpha);
  }

 private:
  struct Step {
    Formula formula;
    size_t target;
    bool whole;
  };

  void load(size_t sample, double alpha) {
    double* value = values_.data() + kPlaces.size();
    for (const auto& [channel, role, set] : variables_.channels) {
      *value = role == Role::Identifier ? double(channel->ids[sample]) : double(channel->values[sample]);
      if (alpha > 0 && isDivided(role)) *value /= alpha;
      ++value;
    }
  }

  // Alpha first: the others are multiplied with it.
  void store(size_t sample, double before, std::span<const float> alpha) {
    for (const bool alphas : {true, false}) {
      const double* value = values_.data() + kPlaces.size();
      for (const auto& [channel, role, set] : variables_.channels) {
        const double now = *value++;
        if (!set || (role == Role::Alpha) != alphas) continue;
        const bool divided = before > 0 && isDivided(role);
        if (role == Role::Identifier)
          channel->ids[sample] = uint32_t(now);
        else
          channel->values[sample] = storable(divided ? now * opacity(alpha[sample]) : now, role);
      }
    }
  }

  const Variables& variables_;
  bool unpremultiplied_;
  std::vector<double> values_;
  std::vector<Step> steps_;
};

}  // namespace

DeepImage expression(DeepImage image, const ExpressionParams& params) {
  const std::vector<Assignment> assignments = parseAssignments(params.set);
  checkNames(image, assignments);
  addMissing(image, assignments);
  const Variables variables = variablesOf(image, assignments, params.unpremultiplied);
  { const Evaluator check(assignments, variables, params.unpremultiplied); }
  const std::span<const float> alpha = params.unpremultiplied ? image.get("A") : std::span<const float>();
  const Box& window = image.dataWindow;
  parallelFor(0, window.height(), [&](int row) {
    Evaluator evaluator(assignments, variables, params.unpremultiplied);
    size_t pixel = size_t(row) * size_t(window.width());
    for (int x = window.x0; x < window.x1; ++x, ++pixel) {
      evaluator.setPlace(x, window.y0 + row, image.count(pixel));
      for (size_t s = image.offsets[pixel]; s < image.offsets[pixel + 1]; ++s)
        evaluator.run(s, s - image.offsets[pixel], alpha);
    }
  });
  dropVoid(image, assignments);
  return image;
}

}  // namespace fathom::deep
