#include "atmos_mocap_bridge/camera/camera_model.h"

#include <cstdio>
#include <fstream>
#include <opencv2/calib3d.hpp>
#include <stdexcept>

#include "atmos_model/strict_yaml.h"
#include "opencv_types.h"

namespace atmos {

Eigen::Vector2d project(const Camera& camera, const Eigen::Vector3d& p_W) {
  const Eigen::Vector3d p_C = camera.X_WC.inverse() * p_W;
  std::vector<cv::Point2d> pixel;
  cv::projectPoints(std::vector<cv::Point3d>{{p_C.x(), p_C.y(), p_C.z()}}, cv::Vec3d(), cv::Vec3d(),
                    camera_matrix(camera.intrinsics), camera.intrinsics.distortion, pixel);
  return {pixel[0].x, pixel[0].y};
}

std::vector<Eigen::Vector2d> undistort(const CameraIntrinsics& intrinsics,
                                       const std::vector<Eigen::Vector2d>& pixels) {
  if (pixels.empty()) return {};
  std::vector<cv::Point2d> in, out;
  for (const Eigen::Vector2d& pixel : pixels) in.emplace_back(pixel.x(), pixel.y());
  cv::undistortPoints(in, out, camera_matrix(intrinsics), intrinsics.distortion);
  std::vector<Eigen::Vector2d> rays;
  for (const cv::Point2d& ray : out) rays.emplace_back(ray.x, ray.y);
  return rays;
}

Extrinsic load_extrinsic(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap root = file.root();
  const Eigen::Vector3d p_WC = root.vector3("position_m");
  const std::vector<double> q = root.numbers("orientation_wxyz", 4, Bounds::between(-1.0, 1.0));
  Extrinsic extrinsic;
  extrinsic.rms_px = root.number("rms_px", Bounds::non_negative());
  Eigen::Quaterniond q_WC = Eigen::Quaterniond::Identity();
  if (!root.faulty("orientation_wxyz")) {
    q_WC = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    if (std::abs(q_WC.norm() - 1.0) > 1e-3) root.fault("orientation_wxyz", "must have length 1");
  }
  file.check();
  extrinsic.X_WC = Eigen::Translation3d(p_WC) * q_WC.normalized();
  return extrinsic;
}

void save_extrinsic(const Extrinsic& extrinsic, const std::string& path) {
  const Eigen::Vector3d p = extrinsic.X_WC.translation();
  const Eigen::Quaterniond q(extrinsic.X_WC.rotation());
  char text[512];
  std::snprintf(
      text, sizeof text,
      "# Where the overhead camera is: camera (x right, y down, z forward) to world. Written by "
      "calibrate_camera.\nposition_m: [%.6f, %.6f, %.6f]\norientation_wxyz: [%.8f, %.8f, %.8f, %.8f]\n"
      "rms_px: %.3f  # of the reprojected corners\n",
      p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z(), extrinsic.rms_px);
  std::ofstream file(path);
  file << text;
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

}  // namespace atmos
