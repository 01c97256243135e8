#include "gslts/reloc/hypotheses.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "ransac.hpp"

namespace gslts::reloc {
namespace {

/// Keyframes that see so many of the features at the same places look at the same part of the map.
constexpr int kShared = 3;
/// Poses that differ by no more are nearly the same.
constexpr double kSame_m = 0.05, kSame_rad = 3 * double(EIGEN_PI) / 180;

template <typename Value>
void require(bool fits, const char* what, Value value) {
  if (fits) return;
  std::ostringstream message;
  message << "hypotheses_of: " << what << ", got " << value;
  throw std::invalid_argument(message.str());
}

void require_positive(double value, const char* what) {
  require(value > 0 && std::isfinite(value), what, value);
}

void validate(const HypothesisRule& rule) {
  require(rule.neighbours >= 1 && rule.neighbours <= 16, "rule.neighbours must be in 1..16",
          rule.neighbours);
  require(rule.most_bits >= 0 && rule.most_bits <= 256, "rule.most_bits must be in 0..256",
          rule.most_bits);
  require(rule.ratio > 0 && rule.ratio <= 1, "rule.ratio must be in (0, 1]", rule.ratio);
  require(rule.elsewhere_m >= 0 && std::isfinite(rule.elsewhere_m),
          "rule.elsewhere_m must not be negative, and finite", rule.elsewhere_m);
  require(rule.keyframes >= 0, "rule.keyframes must not be negative", rule.keyframes);
  require_positive(rule.inlier_px, "rule.inlier_px must be positive and finite");
  require_positive(rule.inlier_depth, "rule.inlier_depth must be positive and finite");
  require(rule.least_inliers >= 4, "rule.least_inliers must be at least 4", rule.least_inliers);
  require(rule.iterations > 0, "rule.iterations must be positive", rule.iterations);
}

bool nearly_same(const Hypothesis& a, const Hypothesis& b) {
  const Eigen::Isometry3d b_from_a = b.world_from_camera.inverse() * a.world_from_camera;
  return b_from_a.translation().norm() <= kSame_m &&
         Eigen::AngleAxisd(b_from_a.linear()).angle() <= kSame_rad;
}

/// A landmark that a feature may be.
struct Candidate {
  Match match;
  int keyframe;
  int bits;  ///< Of the descriptors that differ.
};

class Finder {
 public:
  Finder(const Camera& camera, const Features& features, const float* depths,
         const LandmarkIndex& index, const HypothesisRule& rule)
      : camera_(camera),
        rule_(rule),
        ransac_rule_{rule.inlier_px, rule.inlier_depth, rule.least_inliers, rule.iterations},
        candidates_(features.size()) {
    const LandmarksView landmarks = index.landmarks();
    const Matches matches = index.match(features, rule.neighbours);
    for (std::size_t k = 0; k < matches.landmarks.size(); ++k) {
      if (matches.landmarks[k] < 0) continue;
      const std::size_t feature = k / std::size_t(matches.k),
                        row = std::size_t(matches.landmarks[k]);
      const float depth_m = depths[feature];
      const Eigen::Map<const Eigen::Vector2f> pixel(&features.pixels[2 * feature]);
      const Eigen::Map<const Eigen::Vector3f> x_in_world(landmarks.positions + 3 * row);
      const Match match{pixel.cast<double>(),
                        depth_m > 0 && std::isfinite(depth_m) ? double(depth_m) : 0,
                        x_in_world.cast<double>()};
      candidates_[feature].push_back({match, landmarks.keyframes[row], matches.distances[k]});
    }
  }

  std::vector<Hypothesis> found() {
    try_matches(unambiguous(), -1);
    const std::vector<int> voted = voted_keyframes();
    std::set<int> tried;
    int left = rule_.keyframes;
    for (const int keyframe : voted) {
      if (left == 0) break;
      if (tried.count(keyframe) > 0) continue;
      const std::set<int> group = keyframes_like(keyframe);
      try_matches(matches_in(group), keyframe);
      tried.insert(group.begin(), group.end());
      --left;
    }
    return distinct_hypotheses();
  }

 private:
  bool together(const Match& a, const Match& b) const {
    return (a.x_in_world - b.x_in_world).norm() <= rule_.elsewhere_m;
  }

  /// A corner is found at several levels of the pyramid, but it counts once: few corners must not
  /// look like many inliers.
  MatchSet distinct(const MatchSet& matches) const {
    MatchSet kept;
    for (const Match& match : matches) {
      const bool again = std::any_of(kept.begin(), kept.end(), [&](const Match& other) {
        return (match.pixel - other.pixel).norm() <= rule_.inlier_px && together(match, other);
      });
      if (!again) kept.push_back(match);
    }
    return kept;
  }

  /// Features with one landmark that is much more like them than those elsewhere.
  MatchSet unambiguous() const {
    MatchSet matches;
    for (const std::vector<Candidate>& candidates : candidates_) {
      if (candidates.empty() || candidates[0].bits > rule_.most_bits) continue;
      const auto next = std::find_if(
          candidates.begin(), candidates.end(),
          [&](const Candidate& other) { return !together(candidates[0].match, other.match); });
      if (next == candidates.end() || candidates[0].bits < rule_.ratio * next->bits) {
        matches.push_back(candidates[0].match);
      }
    }
    return distinct(matches);
  }

  /// The one with the most features that may have been seen from it comes first.
  std::vector<int> voted_keyframes() const {
    std::map<int, int> votes;
    for (const std::vector<Candidate>& candidates : candidates_) {
      std::set<int> seen;
      for (const Candidate& candidate : candidates) {
        if (candidate.bits <= rule_.most_bits) seen.insert(candidate.keyframe);
      }
      for (const int keyframe : seen) ++votes[keyframe];
    }
    std::vector<int> keyframes;
    for (const auto& [keyframe, count] : votes) keyframes.push_back(keyframe);
    std::stable_sort(keyframes.begin(), keyframes.end(),
                     [&](int a, int b) { return votes[a] > votes[b]; });
    return keyframes;
  }

  /// The keyframe, and those that see the features at the same places.
  std::set<int> keyframes_like(int keyframe) const {
    std::map<int, int> shared;
    for (const std::vector<Candidate>& candidates : candidates_) {
      for (const Candidate& one : candidates) {
        if (one.keyframe != keyframe || one.bits > rule_.most_bits) continue;
        for (const Candidate& other : candidates) {
          if (other.bits <= rule_.most_bits && together(one.match, other.match)) {
            ++shared[other.keyframe];
          }
        }
      }
    }
    std::set<int> group = {keyframe};
    for (const auto& [other, count] : shared) {
      if (count >= kShared) group.insert(other);
    }
    return group;
  }

  /// Each feature with the landmark of these keyframes that is most like it.
  MatchSet matches_in(const std::set<int>& keyframes) const {
    MatchSet matches;
    for (const std::vector<Candidate>& candidates : candidates_) {
      const auto first =
          std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& one) {
            return one.bits <= rule_.most_bits && keyframes.count(one.keyframe) > 0;
          });
      if (first != candidates.end()) matches.push_back(first->match);
    }
    return distinct(matches);
  }

  /// Each feature with the one of all its landmarks that the pose explains best.
  MatchSet explained(const Eigen::Isometry3d& camera_from_world) const {
    MatchSet matches;
    for (const std::vector<Candidate>& candidates : candidates_) {
      const Match* best = nullptr;
      double most = 0;
      for (const Candidate& one : candidates) {
        if (one.bits > rule_.most_bits) continue;
        const double support = support_of(camera_, camera_from_world, one.match, ransac_rule_);
        if (support <= most) continue;
        most = support;
        best = &one.match;
      }
      if (best) matches.push_back(*best);
    }
    return distinct(matches);
  }

  void try_matches(const MatchSet& matches, int keyframe) {
    const auto first = ransac(camera_, matches, ransac_rule_);
    if (!first) return;
    const Eigen::Isometry3d pose = refined(camera_, *first, explained(*first), ransac_rule_);
    // All are counted alike, whatever they were found with.
    const int inliers = int(explained(pose).size());
    if (inliers >= rule_.least_inliers) hypotheses_.push_back({pose.inverse(), inliers, keyframe});
  }

  std::vector<Hypothesis> distinct_hypotheses() {
    std::stable_sort(
        hypotheses_.begin(), hypotheses_.end(),
        [](const Hypothesis& a, const Hypothesis& b) { return a.inliers > b.inliers; });
    std::vector<Hypothesis> kept;
    for (const Hypothesis& one : hypotheses_) {
      const bool again = std::any_of(kept.begin(), kept.end(), [&](const Hypothesis& other) {
        return nearly_same(one, other);
      });
      if (!again) kept.push_back(one);
    }
    return kept;
  }

  const Camera& camera_;
  const HypothesisRule& rule_;
  RansacRule ransac_rule_;
  std::vector<std::vector<Candidate>> candidates_;  ///< Of each feature, the most like it first.
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace

std::vector<Hypothesis> hypotheses_of(const Camera& camera, const Features& features,
                                      const float* depths, const LandmarkIndex& index,
                                      const HypothesisRule& rule) {
  gslts::validate(camera, "hypotheses_of");
  validate(rule);
  for (std::size_t k = 0; k < features.pixels.size(); ++k) {
    require(std::isfinite(features.pixels[k]), "features.pixels must be finite",
            features.pixels[k]);
  }
  return Finder(camera, features, depths, index, rule).found();
}

}  // namespace gslts::reloc
