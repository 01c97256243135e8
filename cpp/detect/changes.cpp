#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "constants.hpp"
#include "gslts/detect/objects.hpp"

namespace gslts::detect {
namespace {

double log_odds(double probability) { return std::log(probability / (1 - probability)); }

struct Pair {
  double log_odds;  ///< Log odds that both surfaces belong to one object.
  std::size_t before, after;
};

template <typename Value, typename Key>
void sort_descending(std::vector<Value>& values, Key key) {
  std::stable_sort(values.begin(), values.end(),
                   [&](const Value& a, const Value& b) { return key(a) > key(b); });
}

/// Lists the pairs that may be one object, the best match first. One end makes the other more
/// likely, so that one of both may be less certain than a change of its own must be.
std::vector<Pair> matching_pairs(const std::vector<Surface>& surfaces,
                                 const std::vector<double>& confidences, const ObjectRule& rule) {
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    for (std::size_t j = 0; j < surfaces.size(); ++j) {
      if (surfaces[i].side != Side::kBefore || surfaces[j].side != Side::kAfter) continue;
      const auto [lower, higher] = std::minmax({confidences[i], confidences[j]});
      if (higher < rule.min_confidence || lower < kMinEndConfidence * rule.min_confidence) continue;
      const double odds = log_odds(match_score(surfaces[i], surfaces[j])) +
                          kErrorWeight * std::min(0.0, log_odds(lower));
      if (odds >= log_odds(rule.min_match_score)) pairs.push_back({odds, i, j});
    }
  }
  sort_descending(pairs, [](const Pair& pair) { return pair.log_odds; });
  return pairs;
}

/// Returns how likely a surface is an addition or a removal: the other end of a relocation may be
/// hidden. The confidence of colours was fitted to whole changes.
double lone_confidence(const Surface& surface, double confidence) {
  if (surface.color_confidence) return confidence;
  return confidence - kLoneDoubt * std::max(0.0, 2 * confidence - 1);
}

}  // namespace

std::vector<ObjectChange> classify_changes(const std::vector<Surface>& surfaces,
                                           const ObjectRule& rule) {
  validate(rule, "classify_changes");
  std::vector<double> confidences;
  for (const Surface& surface : surfaces) {
    validate(surface, "classify_changes");
    confidences.push_back(confidence(surface));
  }
  std::vector<ObjectChange> changes;
  std::vector<bool> taken(surfaces.size());
  for (const auto& [odds, before, after] : matching_pairs(surfaces, confidences, rule)) {
    if (taken[before] || taken[after]) continue;
    taken[before] = taken[after] = true;
    changes.push_back({ChangeType::kRelocation, std::max(confidences[before], confidences[after]),
                       surfaces[before], surfaces[after]});
  }
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const double confidence = lone_confidence(surfaces[i], confidences[i]);
    if (taken[i] || confidence < rule.min_confidence) continue;
    if (surfaces[i].side == Side::kBefore) {
      changes.push_back({ChangeType::kRemoval, confidence, surfaces[i], std::nullopt});
    } else {
      changes.push_back({ChangeType::kAddition, confidence, std::nullopt, surfaces[i]});
    }
  }
  sort_descending(changes, [](const ObjectChange& change) { return change.confidence; });
  return changes;
}

}  // namespace gslts::detect
