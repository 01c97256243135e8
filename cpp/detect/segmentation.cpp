#include "segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

namespace gslts::detect {
namespace {

/// Two neighbouring pixels.
struct Edge {
  float difference;
  std::uint32_t a, b;
};

/// Segments as trees of pixels, whose roots stand for them.
class Forest {
 public:
  explicit Forest(std::size_t size) : parents_(size), areas_(size, 1), differences_(size, 0) {
    std::iota(parents_.begin(), parents_.end(), std::size_t(0));
  }

  std::size_t root(std::size_t k) {
    while (parents_[k] != k) k = parents_[k] = parents_[parents_[k]];
    return k;
  }

  /// Returns the largest difference that may join a segment with another one.
  float tolerance(std::size_t root, float scale) const {
    return differences_[root] + scale / float(areas_[root]);
  }

  std::size_t area(std::size_t root) const { return areas_[root]; }

  void join(std::size_t a, std::size_t b, float difference) {
    if (areas_[a] < areas_[b]) std::swap(a, b);
    parents_[b] = a;
    areas_[a] += areas_[b];
    differences_[a] = std::max(differences_[a], std::max(differences_[b], difference));
  }

  std::vector<Pixels> segments() {
    std::vector<std::size_t> index(parents_.size(), parents_.size());
    std::vector<Pixels> result;
    for (std::size_t k = 0; k < parents_.size(); ++k) {
      std::size_t& own = index[root(k)];
      if (own == parents_.size()) {
        own = result.size();
        result.emplace_back();
      }
      result[own].push_back(k);
    }
    return result;
  }

 private:
  std::vector<std::size_t> parents_, areas_;
  std::vector<float> differences_;
};

/// Lists all pairs of neighbours, the most similar first, by counting sort in steps of
/// `kDifferenceStep`.
std::vector<Edge> sorted_edges(const cv::Mat& image) {
  constexpr std::size_t kBins = 4096;
  std::vector<Edge> edges;
  edges.reserve(2 * image.total());
  std::vector<std::size_t> starts(kBins + 1, 0);
  const auto bin_of = [](float difference) {
    const float bin = difference / kDifferenceStep;
    return bin < float(kBins) ? std::size_t(bin) : kBins - 1;  // Also of NaN.
  };
  const auto* values = image.ptr<cv::Vec4f>();
  const auto add = [&](std::size_t a, std::size_t b) {
    const cv::Vec4f step = values[a] - values[b];
    const float difference =
        std::sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2] + step[3] * step[3]);
    edges.push_back({difference, std::uint32_t(a), std::uint32_t(b)});
    ++starts[bin_of(difference) + 1];
  };
  const std::size_t width = std::size_t(image.cols);
  for (std::size_t k = 0; k < image.total(); ++k) {
    if ((k + 1) % width) add(k, k + 1);
    if (k + width < image.total()) add(k, k + width);
  }
  std::partial_sum(starts.begin(), starts.end(), starts.begin());
  std::vector<Edge> sorted(edges.size());
  for (const Edge& edge : edges) sorted[starts[bin_of(edge.difference)]++] = edge;
  return sorted;
}

}  // namespace

std::vector<std::vector<Pixels>> segment_image(const cv::Mat& image,
                                               const std::vector<float>& scales, int min_px) {
  const std::vector<Edge> edges = sorted_edges(image);
  std::vector<std::vector<Pixels>> result;
  for (const float scale : scales) {
    Forest forest(image.total());
    for (const auto& [difference, a, b] : edges) {
      const std::size_t i = forest.root(a), j = forest.root(b);
      const float tolerance = std::min(forest.tolerance(i, scale), forest.tolerance(j, scale));
      if (i != j && difference <= tolerance) forest.join(i, j, difference);
    }
    for (const auto& [difference, a, b] : edges) {
      const std::size_t i = forest.root(a), j = forest.root(b);
      const bool small = std::min(forest.area(i), forest.area(j)) < std::size_t(min_px);
      if (i != j && small) forest.join(i, j, difference);
    }
    result.push_back(forest.segments());
  }
  return result;
}

}  // namespace gslts::detect
