#include "atmos_mocap_bridge/camera/planar_pose.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "opencv_types.h"

namespace atmos {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kIterations = 10;
constexpr double kConverged = 1e-10;  // m and rad

const MarkerSettings* find(const std::vector<MarkerSettings>& markers, int id) {
  const auto at =
      std::find_if(markers.begin(), markers.end(), [id](const MarkerSettings& one) { return one.id == id; });
  return at == markers.end() ? nullptr : &*at;
}

Eigen::Matrix2d rotation(double yaw) {
  Eigen::Matrix2d R;
  R << std::cos(yaw), -std::sin(yaw), std::sin(yaw), std::cos(yaw);
  return R;
}

// Pose that turns and shifts the body points onto the world points with least squares (Kabsch, in the plane).
Vector3d rigid_fit(const std::vector<Vector2d>& p_B, const std::vector<Vector2d>& p_W) {
  Vector2d mean_B = Vector2d::Zero(), mean_W = Vector2d::Zero();
  for (std::size_t i = 0; i < p_B.size(); ++i) {
    mean_B += p_B[i] / static_cast<double>(p_B.size());
    mean_W += p_W[i] / static_cast<double>(p_B.size());
  }
  double cosine = 0.0, sine = 0.0;
  for (std::size_t i = 0; i < p_B.size(); ++i) {
    const Vector2d b = p_B[i] - mean_B, w = p_W[i] - mean_W;
    cosine += b.dot(w);
    sine += b.x() * w.y() - b.y() * w.x();
  }
  const double yaw = std::atan2(sine, cosine);
  const Vector2d p = mean_W - rotation(yaw) * mean_B;
  return {p.x(), p.y(), yaw};
}

}  // namespace

std::optional<PlanarFit> fit_planar_pose(const Camera& camera, const FitSettings& settings,
                                         const std::vector<DetectedMarker>& detected) {
  std::vector<Vector2d> p_B, pixels;
  for (const DetectedMarker& marker : detected) {
    const MarkerSettings* const known = find(settings.markers, marker.id);
    if (known == nullptr) continue;
    const auto corners = corners_of(*known);
    p_B.insert(p_B.end(), corners.begin(), corners.end());
    pixels.insert(pixels.end(), marker.corners_px.begin(), marker.corners_px.end());
  }
  const int count = static_cast<int>(p_B.size());
  if (count < settings.min_corners) return std::nullopt;

  const std::vector<Vector2d> rays = undistort(camera.intrinsics, pixels);
  const Eigen::Matrix3d R_WC = camera.X_WC.linear();
  const Vector3d p_WC = camera.X_WC.translation();
  std::vector<Vector2d> p_W;
  for (const Vector2d& ray : rays) {
    const Vector3d direction = R_WC * Vector3d(ray.x(), ray.y(), 1.0);
    if (direction.z() > -1e-3) return std::nullopt;  // above the horizon: not on the floor
    const double range = (settings.height_m - p_WC.z()) / direction.z();
    p_W.push_back((p_WC + range * direction).head<2>());
  }

  Vector3d x = rigid_fit(p_B, p_W);
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double squares = 0.0;
  const Eigen::DiagonalMatrix<double, 2> focal(camera.intrinsics.fx, camera.intrinsics.fy);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    information.setZero();
    Vector3d gradient = Vector3d::Zero();
    squares = 0.0;
    const Eigen::Matrix2d R = rotation(x.z());
    for (std::size_t i = 0; i < p_B.size(); ++i) {
      const Vector2d arm = R * p_B[i];
      const Vector3d p_C =
          R_WC.transpose() * (Vector3d(x.x() + arm.x(), x.y() + arm.y(), settings.height_m) - p_WC);
      const double depth = p_C.z();
      const Vector2d residual = focal * (rays[i] - p_C.head<2>() / depth);
      Eigen::Matrix3d motion;  // of the corner in the world with x, y and yaw
      motion << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x(), 0.0, 0.0, 0.0;
      Eigen::Matrix<double, 2, 3> perspective;
      perspective << 1.0 / depth, 0.0, -p_C.x() / (depth * depth), 0.0, 1.0 / depth,
          -p_C.y() / (depth * depth);
      const Eigen::Matrix<double, 2, 3> J = focal * perspective * R_WC.transpose() * motion;
      information += J.transpose() * J;
      gradient += J.transpose() * residual;
      squares += residual.squaredNorm();
    }
    const Eigen::LDLT<Eigen::Matrix3d> factor(information);
    const Vector3d step = factor.solve(gradient);
    if (factor.info() != Eigen::Success || !step.allFinite()) return std::nullopt;
    x += step;
    if (step.norm() < kConverged) break;
  }
  PlanarFit fit;
  fit.p_WB = x.head<2>();
  fit.yaw = std::remainder(x.z(), 2.0 * M_PI);
  fit.corners = count;
  fit.rms_px = std::sqrt(squares / (2.0 * count - 3.0));
  if (!(fit.rms_px <= settings.max_reprojection_px)) return std::nullopt;
  const double sigma = std::max(settings.corner_noise_px, fit.rms_px);
  fit.covariance = sigma * sigma * information.inverse();
  return fit;
}

PoseFrame to_pose_frame(const PlanarFit& fit, double stamp_s, const MocapConfig& config) {
  PoseFrame frame{stamp_s,
                  {fit.p_WB.x(), fit.p_WB.y(), 0.0},
                  Eigen::Quaterniond(Eigen::AngleAxisd(fit.yaw, Vector3d::UnitZ()))};
  const double z = config.position_noise_m, tilt = config.attitude_noise_rad;
  Matrix6 covariance = Matrix6::Zero();
  covariance.diagonal() << 0.0, 0.0, z * z, tilt * tilt, tilt * tilt, 0.0;
  const int index[] = {0, 1, 5};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) covariance(index[i], index[k]) = fit.covariance(i, k);
  }
  frame.covariance = covariance;
  return frame;
}

PoseFrame unseen_frame(double stamp_s) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  return {stamp_s, Vector3d::Constant(nan), Eigen::Quaterniond(nan, nan, nan, nan)};
}

std::optional<Extrinsic> fit_extrinsic(const CameraIntrinsics& intrinsics,
                                       const std::vector<MarkerSettings>& floor_markers,
                                       const std::vector<std::vector<DetectedMarker>>& images) {
  std::vector<cv::Point3d> world;
  std::vector<cv::Point2d> pixels;
  std::vector<int> ids;
  for (const auto& image : images) {
    for (const DetectedMarker& marker : image) {
      const MarkerSettings* const known = find(floor_markers, marker.id);
      if (known == nullptr) continue;
      ids.push_back(marker.id);
      const auto corners = corners_of(*known);
      for (std::size_t k = 0; k < 4; ++k) {
        world.emplace_back(corners[k].x(), corners[k].y(), 0.0);
        pixels.emplace_back(marker.corners_px[k].x(), marker.corners_px[k].y());
      }
    }
  }
  std::sort(ids.begin(), ids.end());
  if (std::unique(ids.begin(), ids.end()) - ids.begin() < 2) return std::nullopt;
  cv::Vec3d turn, shift;
  if (!cv::solvePnP(world, pixels, camera_matrix(intrinsics), intrinsics.distortion, turn, shift))
    return std::nullopt;
  std::vector<cv::Point2d> projected;
  cv::projectPoints(world, turn, shift, camera_matrix(intrinsics), intrinsics.distortion, projected);
  double squares = 0.0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const cv::Point2d difference = projected[i] - pixels[i];
    squares += difference.dot(difference);
  }
  const Vector3d axis(turn[0], turn[1], turn[2]);
  Eigen::Isometry3d X_CW = Eigen::Isometry3d::Identity();
  if (axis.norm() > 0.0) X_CW.rotate(Eigen::AngleAxisd(axis.norm(), axis.normalized()));
  X_CW.pretranslate(Vector3d(shift[0], shift[1], shift[2]));
  Extrinsic extrinsic;
  extrinsic.X_WC = X_CW.inverse();
  extrinsic.rms_px = std::sqrt(squares / (2.0 * static_cast<double>(pixels.size())));
  if (extrinsic.X_WC.translation().z() <= 0.0) return std::nullopt;  // below the floor it sees
  return extrinsic;
}

}  // namespace atmos
