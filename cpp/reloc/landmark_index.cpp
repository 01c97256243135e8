#include "gslts/reloc/landmark_index.hpp"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/flann/miniflann.hpp>
#include <stdexcept>
#include <string>

#include "gslts/map/require.hpp"

namespace gslts::reloc {
namespace {

/// Maximum number of landmarks per feature; bounds the memory of a match.
constexpr int kMaxNeighbours = 16;
constexpr int kDescriptorBits = 8 * int(kDescriptorBytes);

/// Hash tables, bits of a key, and bits of it that may differ. Among 54,000 landmarks of a real
/// room they find 9 of 10 nearest neighbours. One probed bit more takes five times as long and
/// finds no more poses.
constexpr int kTables = 12, kKeyBits = 20, kProbedBits = 1;

/// Seeds OpenCV's random generator of this thread, from which FLANN draws the bits of its keys, and
/// restores its state at the end.
class FixedRandom {
 public:
  FixedRandom() : before_(cv::theRNG()) { cv::theRNG() = cv::RNG(1); }
  ~FixedRandom() { cv::theRNG() = before_; }
  FixedRandom(const FixedRandom&) = delete;
  FixedRandom& operator=(const FixedRandom&) = delete;

 private:
  cv::RNG before_;
};

/// OpenCV takes a non-const pointer, but only reads.
cv::Mat rows_of(const Array<std::uint8_t>& descriptors) {
  return {int(descriptors.size() / kDescriptorBytes), int(kDescriptorBytes), CV_8U,
          const_cast<std::uint8_t*>(descriptors.data())};
}

[[noreturn]] void fail(const std::string& message) { throw std::invalid_argument(message); }

void validate(const LandmarksView& landmarks) {
  require_finite_points("LandmarkIndex", "positions", landmarks.positions, landmarks.size);
  for (std::size_t i = 0; i < landmarks.size; ++i) {
    if (landmarks.keyframes[i] < 0) {
      fail("LandmarkIndex: keyframes[" + std::to_string(i) + "] must not be negative, got " +
           std::to_string(landmarks.keyframes[i]));
    }
  }
}

}  // namespace

struct LandmarkIndex::Index {
  Array<float> positions;
  Array<std::uint8_t> descriptors;
  Array<std::int32_t> keyframes;
  cv::flann::Index hashes;  ///< Hash tables of the descriptors.
};

LandmarkIndex::LandmarkIndex(const LandmarksView& landmarks) {
  validate(landmarks);
  const auto copy = [&](const auto* from, std::size_t columns) {
    return Array<std::decay_t<decltype(*from)>>(from, from + columns * landmarks.size);
  };
  index_ = std::make_unique<Index>();
  index_->positions = copy(landmarks.positions, 3);
  index_->descriptors = copy(landmarks.descriptors, kDescriptorBytes);
  index_->keyframes = copy(landmarks.keyframes, 1);
  if (landmarks.size == 0) return;
  const FixedRandom fixed;
  index_->hashes.build(rows_of(index_->descriptors),
                       cv::flann::LshIndexParams(kTables, kKeyBits, kProbedBits),
                       cvflann::FLANN_DIST_HAMMING);
}

LandmarkIndex::~LandmarkIndex() = default;
LandmarkIndex::LandmarkIndex(LandmarkIndex&&) noexcept = default;
LandmarkIndex& LandmarkIndex::operator=(LandmarkIndex&&) noexcept = default;

LandmarksView LandmarkIndex::landmarks() const {
  return {index_->keyframes.size(), index_->positions.data(), index_->descriptors.data(),
          index_->keyframes.data()};
}

Matches LandmarkIndex::match(const Features& features, int k) const {
  if (k < 1 || k > kMaxNeighbours) {
    fail("LandmarkIndex.match: k must be in 1..16, got " + std::to_string(k));
  }
  const std::size_t count = features.size(), columns = std::size_t(k);
  if (features.descriptors.size() != count * kDescriptorBytes) {
    fail("LandmarkIndex.match: expected " + std::to_string(count * kDescriptorBytes) +
         " bytes of descriptors, got " + std::to_string(features.descriptors.size()));
  }
  Matches matches{k, Array<std::int32_t>(count * columns, -1),
                  Array<std::int32_t>(count * columns, kDescriptorBits)};
  if (count == 0 || index_->keyframes.empty()) return matches;
  // FLANN searches for no more landmarks than there are.
  const int searched = int(std::min(columns, index_->keyframes.size()));
  cv::Mat landmarks(int(count), searched, CV_32S, cv::Scalar(-1));
  cv::Mat distances(int(count), searched, CV_32S, cv::Scalar(kDescriptorBits));
  index_->hashes.knnSearch(rows_of(features.descriptors), landmarks, distances, searched);
  const cv::Range first(0, searched);
  landmarks.copyTo(cv::Mat(int(count), k, CV_32S, matches.landmarks.data()).colRange(first));
  distances.copyTo(cv::Mat(int(count), k, CV_32S, matches.distances.data()).colRange(first));
  // FLANN leaves the largest integer where it finds fewer.
  for (std::int32_t& distance : matches.distances) distance = std::min(distance, kDescriptorBits);
  return matches;
}

}  // namespace gslts::reloc
