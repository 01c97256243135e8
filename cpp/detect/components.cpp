#include "gslts/detect/components.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <tuple>

namespace gslts::detect {

Components connected_components(const std::uint8_t* mask, int width, int height) {
  if (width <= 0 || height <= 0) {
    throw std::invalid_argument("connected_components: the image must not be empty");
  }
  const cv::Mat image(height, width, CV_8U, const_cast<std::uint8_t*>(mask));
  Components result;
  result.labels.resize(std::size_t(width) * height);
  cv::Mat labels(height, width, CV_32S, result.labels.data()), stats, centroids;
  const int count = cv::connectedComponentsWithStats(image, labels, stats, centroids, 8, CV_32S);
  for (int label = 1; label < count; ++label) {
    const int* stat = stats.ptr<int>(label);
    const double* centroid = centroids.ptr<double>(label);
    // OpenCV's first pixel has its centre at 0.
    result.components.push_back({label, stat[cv::CC_STAT_AREA], stat[cv::CC_STAT_LEFT],
                                 stat[cv::CC_STAT_TOP], stat[cv::CC_STAT_WIDTH],
                                 stat[cv::CC_STAT_HEIGHT], centroid[0] + 0.5, centroid[1] + 0.5});
  }
  const auto before = [](const Component& a, const Component& b) {
    return std::tuple(-a.area, a.y, a.x, a.label) < std::tuple(-b.area, b.y, b.x, b.label);
  };
  std::sort(result.components.begin(), result.components.end(), before);
  return result;
}

}  // namespace gslts::detect
