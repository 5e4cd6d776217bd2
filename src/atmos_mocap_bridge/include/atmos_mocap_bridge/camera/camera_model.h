// A pinhole camera with lens distortion, and where it is.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

namespace atmos {

// As in sensor_msgs/CameraInfo with the distortion model plumb_bob: pixels, k1 k2 p1 p2 k3 (or none).
struct CameraIntrinsics {
  int width, height;
  double fx, fy, cx, cy;
  std::vector<double> distortion;
};

// An 8-bit grey image in somebody else's memory, row by row.
struct GrayImage {
  int width, height;
  const std::uint8_t* data;
  std::size_t step;  // bytes from row to row
};

// X_WC: camera (x right, y down, z forward) to world.
struct Camera {
  CameraIntrinsics intrinsics;
  Eigen::Isometry3d X_WC;
};

// Pixel of a point in the world; it must be in front of the camera.
Eigen::Vector2d project(const Camera& camera, const Eigen::Vector3d& p_W);

// Direction (x, y, 1) in the camera's frame of each pixel: the distortion taken back.
std::vector<Eigen::Vector2d> undistort(const CameraIntrinsics& intrinsics,
                                       const std::vector<Eigen::Vector2d>& pixels);

// Where the camera is, and how well the calibration fitted.
struct Extrinsic {
  Eigen::Isometry3d X_WC;
  double rms_px = 0.0;
};
// Throws ConfigError with every fault.
Extrinsic load_extrinsic(const std::string& path);
// Throws std::runtime_error when the file cannot be written.
void save_extrinsic(const Extrinsic& extrinsic, const std::string& path);

}  // namespace atmos
