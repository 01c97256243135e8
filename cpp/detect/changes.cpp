#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "gslts/detect/objects.hpp"
#include "rules.hpp"

namespace gslts::detect {
namespace {

/// One end may be so much less certain than a change of its own must be.
constexpr double kLeastCertain = 0.2;
/// How much an end that may be an error counts against both being one object.
constexpr double kDoubt = 0.5;

double log_odds(double probability) { return std::log(probability / (1 - probability)); }

struct Pair {
  double odds;  ///< That they are one object, logarithmic.
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
      const double alike = likeness(surfaces[i], surfaces[j]);
      const double odds = log_odds(alike) + kDoubt * std::min(0.0, log_odds(least));
      if (odds >= log_odds(rule.alike)) pairs.push_back({odds, i, j});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.odds > b.odds; });
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
