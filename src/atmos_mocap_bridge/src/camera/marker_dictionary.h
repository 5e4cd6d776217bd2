// OpenCV's dictionaries by name.
#pragma once

#include <opencv2/aruco.hpp>
#include <string>

namespace atmos {

// Throws std::invalid_argument for a name that is not in marker_dictionaries().
cv::Ptr<cv::aruco::Dictionary> marker_dictionary(const std::string& name);

}  // namespace atmos
