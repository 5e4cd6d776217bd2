// ArUco markers in an image, with sub-pixel corners.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "atmos_mocap_bridge/camera/camera_model.h"
#include "atmos_mocap_bridge/config.h"

namespace atmos {

struct DetectedMarker {
  int id;
  std::array<Eigen::Vector2d, 4> corners_px;  // clockwise from the marker's own top left
};

// The names that config files may use for OpenCV's dictionaries.
std::vector<std::string> marker_dictionaries();

class MarkerDetector {
 public:
  // Throws std::invalid_argument for a name that is not in marker_dictionaries().
  explicit MarkerDetector(const std::string& dictionary);
  ~MarkerDetector();

  std::vector<DetectedMarker> detect(const GrayImage& image) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The corners of a marker in the order of DetectedMarker, in the frame of its center_m.
std::array<Eigen::Vector2d, 4> corners_of(const MarkerSettings& marker);

}  // namespace atmos
