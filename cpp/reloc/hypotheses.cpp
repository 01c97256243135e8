#include "gslts/reloc/hypotheses.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "gslts/map/require.hpp"
#include "gslts/map/se3.hpp"
#include "ransac.hpp"

namespace gslts::reloc {
namespace {

/// Name in messages.
constexpr const char* kFunction = "hypotheses_of";

/// Minimum number of features whose landmarks coincide in two keyframes that see the same part of
/// the map.
constexpr int kMinShared = 3;
/// Maximum distance of two poses that count as one hypothesis, m and rad.
constexpr double kSame_m = 0.05, kSame_rad = 3 * double(EIGEN_PI) / 180;

void require_positive(double value, const char* what) {
  require(value > 0 && std::isfinite(value), kFunction, what, value);
}

void validate(const HypothesisRule& rule) {
  require(rule.neighbours >= 1 && rule.neighbours <= 16, kFunction,
          "rule.neighbours must be in 1..16", rule.neighbours);
  require(rule.max_bits >= 0 && rule.max_bits <= 256, kFunction, "rule.max_bits must be in 0..256",
          rule.max_bits);
  require(rule.ratio > 0 && rule.ratio <= 1, kFunction, "rule.ratio must be in (0, 1]", rule.ratio);
  require(rule.same_landmark_m >= 0 && std::isfinite(rule.same_landmark_m), kFunction,
          "rule.same_landmark_m must not be negative, and finite", rule.same_landmark_m);
  require(rule.keyframes >= 0, kFunction, "rule.keyframes must not be negative", rule.keyframes);
  require_positive(rule.inlier_px, "rule.inlier_px must be positive and finite");
  require_positive(rule.inlier_depth, "rule.inlier_depth must be positive and finite");
  require(rule.min_inliers >= 4, kFunction, "rule.min_inliers must be at least 4",
          rule.min_inliers);
  require(rule.iterations > 0, kFunction, "rule.iterations must be positive", rule.iterations);
}

bool nearly_same(const Hypothesis& a, const Hypothesis& b) {
  const PoseDistance distance = pose_distance(a.world_from_camera, b.world_from_camera);
  return distance.m <= kSame_m && distance.rad <= kSame_rad;
}

/// A possible landmark of a feature.
struct Candidate {
  Match match;
  int keyframe;
  int bits;  ///< Hamming distance of the descriptors.
};

class HypothesisFinder {
 public:
  HypothesisFinder(const Camera& camera, const Features& features, const float* depths,
                   const LandmarkIndex& index, const HypothesisRule& rule)
      : camera_(camera),
        rule_(rule),
        ransac_rule_{rule.inlier_px, rule.inlier_depth, rule.min_inliers, rule.iterations},
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

  std::vector<Hypothesis> find() {
    try_matches(unambiguous(), -1);
    std::set<int> tried;
    int left = rule_.keyframes;
    for (const int keyframe : keyframes_by_votes()) {
      if (left == 0) break;
      if (tried.count(keyframe) > 0) continue;
      const std::set<int> group = keyframes_near(keyframe);
      try_matches(matches_in(group), keyframe);
      tried.insert(group.begin(), group.end());
      --left;
    }
    return distinct_hypotheses();
  }

 private:
  bool together(const Match& a, const Match& b) const {
    return (a.x_in_world - b.x_in_world).norm() <= rule_.same_landmark_m;
  }

  /// Removes repeated matches: a keypoint is detected at several levels of the pyramid, and must
  /// count as one inlier.
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

  /// Matches of features whose best landmark passes the ratio test against those elsewhere.
  MatchSet unambiguous() const {
    MatchSet matches;
    for (const std::vector<Candidate>& candidates : candidates_) {
      if (candidates.empty() || candidates[0].bits > rule_.max_bits) continue;
      const auto next = std::find_if(
          candidates.begin(), candidates.end(),
          [&](const Candidate& other) { return !together(candidates[0].match, other.match); });
      if (next == candidates.end() || candidates[0].bits < rule_.ratio * next->bits) {
        matches.push_back(candidates[0].match);
      }
    }
    return distinct(matches);
  }

  /// Keyframes by their number of matched features, the most first.
  std::vector<int> keyframes_by_votes() const {
    std::map<int, int> votes;
    for (const std::vector<Candidate>& candidates : candidates_) {
      std::set<int> seen;
      for (const Candidate& candidate : candidates) {
        if (candidate.bits <= rule_.max_bits) seen.insert(candidate.keyframe);
      }
      for (const int keyframe : seen) ++votes[keyframe];
    }
    std::vector<int> keyframes;
    for (const auto& [keyframe, count] : votes) keyframes.push_back(keyframe);
    std::stable_sort(keyframes.begin(), keyframes.end(),
                     [&](int a, int b) { return votes[a] > votes[b]; });
    return keyframes;
  }

  /// The keyframe, and those that see the same features at the same positions.
  std::set<int> keyframes_near(int keyframe) const {
    std::map<int, int> shared;
    for (const std::vector<Candidate>& candidates : candidates_) {
      for (const Candidate& seen : candidates) {
        if (seen.keyframe != keyframe || seen.bits > rule_.max_bits) continue;
        for (const Candidate& other : candidates) {
          if (other.bits <= rule_.max_bits && together(seen.match, other.match)) {
            ++shared[other.keyframe];
          }
        }
      }
    }
    std::set<int> group = {keyframe};
    for (const auto& [other, count] : shared) {
      if (count >= kMinShared) group.insert(other);
    }
    return group;
  }

  /// Matches of each feature with its best landmark of these keyframes.
  MatchSet matches_in(const std::set<int>& keyframes) const {
    MatchSet matches;
    for (const std::vector<Candidate>& candidates : candidates_) {
      const auto first =
          std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& candidate) {
            return candidate.bits <= rule_.max_bits && keyframes.count(candidate.keyframe) > 0;
          });
      if (first != candidates.end()) matches.push_back(first->match);
    }
    return distinct(matches);
  }

  /// Matches of each feature with that of its landmarks which the pose explains best.
  MatchSet explained(const Eigen::Isometry3d& camera_from_world) const {
    MatchSet matches;
    for (const std::vector<Candidate>& candidates : candidates_) {
      const Match* best = nullptr;
      double max_support = 0;
      for (const Candidate& candidate : candidates) {
        if (candidate.bits > rule_.max_bits) continue;
        const double support =
            support_of(camera_, camera_from_world, candidate.match, ransac_rule_);
        if (support <= max_support) continue;
        max_support = support;
        best = &candidate.match;
      }
      if (best) matches.push_back(*best);
    }
    return distinct(matches);
  }

  void try_matches(const MatchSet& matches, int keyframe) {
    const auto first = ransac(camera_, matches, ransac_rule_);
    if (!first) return;
    const Eigen::Isometry3d pose = refine_inliers(camera_, *first, explained(*first), ransac_rule_);
    // Inliers of all hypotheses are counted over all features, to be comparable.
    const int inliers = int(explained(pose).size());
    if (inliers >= rule_.min_inliers) hypotheses_.push_back({pose.inverse(), inliers, keyframe});
  }

  std::vector<Hypothesis> distinct_hypotheses() {
    std::stable_sort(
        hypotheses_.begin(), hypotheses_.end(),
        [](const Hypothesis& a, const Hypothesis& b) { return a.inliers > b.inliers; });
    std::vector<Hypothesis> kept;
    for (const Hypothesis& hypothesis : hypotheses_) {
      const bool again = std::any_of(kept.begin(), kept.end(), [&](const Hypothesis& other) {
        return nearly_same(hypothesis, other);
      });
      if (!again) kept.push_back(hypothesis);
    }
    return kept;
  }

  const Camera& camera_;
  const HypothesisRule& rule_;
  RansacRule ransac_rule_;
  std::vector<std::vector<Candidate>> candidates_;  ///< By feature, the most similar first.
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace

std::vector<Hypothesis> hypotheses_of(const Camera& camera, const Features& features,
                                      const float* depths, const LandmarkIndex& index,
                                      const HypothesisRule& rule) {
  gslts::validate(camera, "hypotheses_of");
  validate(rule);
  for (std::size_t k = 0; k < features.pixels.size(); ++k) {
    require(std::isfinite(features.pixels[k]), kFunction, "features.pixels must be finite",
            features.pixels[k]);
  }
  return HypothesisFinder(camera, features, depths, index, rule).find();
}

}  // namespace gslts::reloc
