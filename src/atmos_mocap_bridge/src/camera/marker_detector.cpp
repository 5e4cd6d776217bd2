#include "atmos_mocap_bridge/camera/marker_detector.h"

#include "marker_dictionary.h"

namespace atmos {

struct MarkerDetector::Impl {
  cv::Ptr<cv::aruco::Dictionary> dictionary;
  cv::Ptr<cv::aruco::DetectorParameters> parameters;
};

MarkerDetector::MarkerDetector(const std::string& dictionary) : impl_(std::make_unique<Impl>()) {
  impl_->dictionary = marker_dictionary(dictionary);
  impl_->parameters = cv::aruco::DetectorParameters::create();
  impl_->parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  impl_->parameters->cornerRefinementWinSize = 3;  // markers may be as small as 25 pixels: 4 a bit
  impl_->parameters->cornerRefinementMaxIterations = 50;
  impl_->parameters->cornerRefinementMinAccuracy = 0.005;
  // One threshold, as wide as a marker of the usual size: the light on a laboratory's floor is even.
  impl_->parameters->adaptiveThreshWinSizeMin = impl_->parameters->adaptiveThreshWinSizeMax = 23;
  impl_->parameters->minMarkerPerimeterRate = 0.04;
}

MarkerDetector::~MarkerDetector() = default;

std::vector<DetectedMarker> MarkerDetector::detect(const GrayImage& image) const {
  // OpenCV has no read-only header; the detector does not write.
  const cv::Mat view(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data), image.step);
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  try {
    cv::aruco::detectMarkers(view, impl_->dictionary, corners, ids, impl_->parameters);
  } catch (const cv::Exception&) {
    return {};  // a picture too small for the detector's windows shows nothing
  }
  std::vector<DetectedMarker> markers;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    DetectedMarker marker;
    marker.id = ids[i];
    for (std::size_t k = 0; k < 4; ++k) marker.corners_px[k] = {corners[i][k].x, corners[i][k].y};
    markers.push_back(marker);
  }
  return markers;
}

std::array<Eigen::Vector2d, 4> corners_of(const MarkerSettings& marker) {
  const double h = 0.5 * marker.size_m;
  const Eigen::Vector2d& c = marker.center_m;
  return {c + Eigen::Vector2d(-h, h), c + Eigen::Vector2d(h, h), c + Eigen::Vector2d(h, -h),
          c + Eigen::Vector2d(-h, -h)};
}

}  // namespace atmos
