#include "color_constancy.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "constants.hpp"
#include "order_statistics.hpp"

namespace gslts::detect {
namespace {

/// Computes the logarithms of the ratios of two images.
cv::Mat log_ratio(const cv::Mat& observed, const cv::Mat& rendered) {
  cv::Mat ratio;
  cv::divide(cv::max(observed, 0) + cv::Scalar::all(kDarkGain),
             cv::max(rendered, 0) + cv::Scalar::all(kDarkGain), ratio);
  cv::log(ratio, ratio);
  return ratio;
}

/// Blurs an image, at a low resolution as the result has no detail.
cv::Mat blur_widely(const cv::Mat& image) {
  const double sigma_px = kLightScale * image.cols;
  const int shrink = std::max(1, int(sigma_px / 3));
  const cv::Size size(std::max(1, image.cols / shrink), std::max(1, image.rows / shrink));
  cv::Mat blurred;
  cv::resize(image, blurred, size, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(blurred, blurred, {}, sigma_px / shrink, 0, cv::BORDER_REPLICATE);
  cv::resize(blurred, blurred, image.size(), 0, 0, cv::INTER_LINEAR);
  return blurred;
}

/// Returns for each pixel the largest deviation of a channel from the gain.
std::vector<float> deviations(const cv::Mat& ratio, const cv::Mat& log_gain) {
  std::vector<float> errors(ratio.total());
  for (std::size_t k = 0; k < errors.size(); ++k) {
    for (std::size_t c = 3 * k; c < 3 * k + 3; ++c) {
      errors[k] = std::max(errors[k], std::abs(ratio.ptr<float>()[c] - log_gain.ptr<float>()[c]));
    }
  }
  return errors;
}

/// Returns the largest deviation that counts as agreement.
float max_deviation(const std::vector<float>& errors, const cv::Mat& known, bool first) {
  std::vector<double> valid;
  for (std::size_t k = 0; k < errors.size(); ++k) {
    if (known.ptr<std::uint8_t>()[k]) valid.push_back(errors[k]);
  }
  if (valid.empty()) return 0;
  if (first) return float(quantile(valid, kFirstAgreeingShare));
  return float(kMaxDeviation * std::max(kMinDeviation, quantile(valid, 0.5)));
}

}  // namespace

cv::Mat match_light(const cv::Mat& rendered, const cv::Mat& observed, const cv::Mat& known) {
  const cv::Mat ratio = log_ratio(observed, rendered);
  cv::Mat log_gain = cv::Mat::zeros(ratio.size(), CV_32FC3);
  for (int fit = 0; fit < kLightFits; ++fit) {
    const std::vector<float> errors = deviations(ratio, log_gain);
    const float limit = max_deviation(errors, known, fit == 0);
    cv::Mat weights(ratio.size(), CV_32F), weighted(ratio.size(), CV_32FC3);
    for (std::size_t k = 0; k < errors.size(); ++k) {
      const float weight = known.ptr<std::uint8_t>()[k] && errors[k] < limit ? 1.0f : 0.0f;
      weights.ptr<float>()[k] = weight;
      for (std::size_t c = 3 * k; c < 3 * k + 3; ++c) {
        weighted.ptr<float>()[c] = weight * ratio.ptr<float>()[c];
      }
    }
    const cv::Mat total = blur_widely(weights) + kTinyWeight;
    weighted = blur_widely(weighted);
    for (std::size_t k = 0; k < errors.size(); ++k) {
      for (std::size_t c = 3 * k; c < 3 * k + 3; ++c) {
        log_gain.ptr<float>()[c] = weighted.ptr<float>()[c] / total.ptr<float>()[k];
      }
    }
  }
  cv::Mat gain;
  cv::exp(log_gain, gain);
  return (rendered + cv::Scalar::all(kDarkGain)).mul(gain) - cv::Scalar::all(kDarkGain);
}

}  // namespace gslts::detect
