// The pose on the floor of a board of markers, and the pose of a camera over a floor with markers.
#pragma once

#include <optional>
#include <vector>

#include "atmos_mocap_bridge/camera/marker_detector.h"
#include "atmos_mocap_bridge/pose_filter.h"

namespace atmos {

struct PlanarFit {
  Eigen::Vector2d p_WB;        // m
  double yaw;                  // rad
  Eigen::Matrix3d covariance;  // of x, y, yaw
  double rms_px;               // of the reprojected corners, per axis
  int corners;
};

struct FitSettings {
  std::vector<MarkerSettings> markers;  // of the board, body
  double height_m;                      // of the board over the floor
  int min_corners;
  double corner_noise_px;
  double max_reprojection_px;
};

// Height and tilt are those of the floor, so three numbers remain: the point of least squares of the
// reprojection in undistorted pixels (Gauss-Newton). The covariance is that of the corners' noise or of what
// the reprojection shows, whichever is larger. Nothing when too few corners of the board are among the
// markers or the fit is worse than max_reprojection_px.
std::optional<PlanarFit> fit_planar_pose(const Camera& camera, const FitSettings& settings,
                                         const std::vector<DetectedMarker>& detected);

// As a frame of the filter: out-of-plane components are zero, their noise that of the settings.
PoseFrame to_pose_frame(const PlanarFit& fit, double stamp_s, const MocapConfig& config);
PoseFrame unseen_frame(double stamp_s);

// The camera's pose out of markers on the floor whose places in the world are known (center_m; x along world
// x). `images`: detections of one or more images. Nothing with fewer than two markers or without a solution.
std::optional<Extrinsic> fit_extrinsic(const CameraIntrinsics& intrinsics,
                                       const std::vector<MarkerSettings>& floor_markers,
                                       const std::vector<std::vector<DetectedMarker>>& images);

}  // namespace atmos
