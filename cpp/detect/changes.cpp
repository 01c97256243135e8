#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "gslts/detect/objects.hpp"
#include "rules.hpp"

namespace gslts::detect {
namespace {

/// A difference of sRGB colours by which two surfaces look half alike.
constexpr double kColorStep = 0.2;
/// Of a difference in brightness, which light and shade change from place to place.
constexpr double kBrightnessShare = 0.5;
/// Of an object at least so much of its length is seen at both ends.
constexpr double kLeastLength = 0.35;

/// 0 to 1: whether these may be one object, by colour and size. Parts of either may be hidden.
double likeness(const Surface& a, const Surface& b) {
  const double one = (a.high - a.low).norm(), other = (b.high - b.low).norm();
  const double lengths = std::min(one, other) / std::max({one, other, 1e-9});
  if (lengths < kLeastLength) return 0;
  const Eigen::Vector3d difference = a.color - b.color;
  const Eigen::Vector3d brightness = Eigen::Vector3d::Constant(difference.mean());
  const double step = (difference - (1 - kBrightnessShare) * brightness).norm();
  return std::sqrt(lengths) * std::exp2(-step / kColorStep);
}

/// 0 to 1: how likely a surface is that of an object and no error.
///
/// Logistic regression over surfaces that were found in simulated homes (seeds below 10,000):
/// benchmarks/README.md.
double certainty(const Surface& surface) {
  constexpr double kSteps = 3.1, kArea = 0.78, kFlat = -2.0, kOffset = 3.0;
  constexpr double kLook = 0.3;   // Where so many pixels look otherwise, all of it does.
  constexpr double kBlind = 0.3;  // What steps count where nothing looks otherwise.
  const double look = std::min(1.0, surface.differing / kLook);
  const double evidence = surface.steps * (kBlind + (1 - kBlind) * look);
  const double sum = kSteps * std::log(evidence + 0.01) + kArea * std::log(surface.area_m2 + 1e-9) +
                     (surface.flat ? kFlat : 0) + kOffset;
  return 1 / (1 + std::exp(-sum));
}

/// By how much more alike two surfaces must be if one of them may be an error.
constexpr double kDoubt = 0.15;
/// One end may be so much less certain than a change of its own must be.
constexpr double kLeastCertain = 0.3;

struct Pair {
  double excess;  ///< By which they are more alike than they must be.
  std::size_t before, after;
};

/// Those that may be one object, the most alike first. One end makes the other more likely.
std::vector<Pair> pairs_of(const std::vector<Surface>& surfaces, const ObjectRule& rule) {
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    for (std::size_t j = 0; j < surfaces.size(); ++j) {
      if (surfaces[i].side != Side::kBefore || surfaces[j].side != Side::kAfter) continue;
      const auto [least, most] = std::minmax({certainty(surfaces[i]), certainty(surfaces[j])});
      if (most < rule.certain || least < kLeastCertain * rule.certain) continue;
      const double excess = likeness(surfaces[i], surfaces[j]) - rule.alike - kDoubt * (1 - least);
      if (excess >= 0) pairs.push_back({excess, i, j});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.excess > b.excess; });
  return pairs;
}

}  // namespace

std::vector<ObjectChange> changes_of(const std::vector<Surface>& surfaces, const ObjectRule& rule) {
  validate(rule, "changes_of");
  std::vector<ObjectChange> changes;
  std::vector<bool> taken(surfaces.size());
  for (const Pair& pair : pairs_of(surfaces, rule)) {
    if (taken[pair.before] || taken[pair.after]) continue;
    taken[pair.before] = taken[pair.after] = true;
    const Surface &before = surfaces[pair.before], &after = surfaces[pair.after];
    changes.push_back(
        {ChangeType::kRelocation, std::max(certainty(before), certainty(after)), before, after});
  }
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const Surface& surface = surfaces[i];
    if (taken[i] || certainty(surface) < rule.certain) continue;
    if (surface.side == Side::kBefore) {
      changes.push_back({ChangeType::kRemoval, certainty(surface), surface, std::nullopt});
    } else {
      changes.push_back({ChangeType::kAddition, certainty(surface), std::nullopt, surface});
    }
  }
  std::vector<std::size_t> order(changes.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return changes[a].confidence > changes[b].confidence;
  });
  std::vector<ObjectChange> ordered;
  for (const std::size_t k : order) ordered.push_back(changes[k]);
  return ordered;
}

}  // namespace gslts::detect
