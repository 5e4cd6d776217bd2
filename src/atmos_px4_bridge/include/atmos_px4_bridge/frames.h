// The one place where ENU/FLU meets NED/FRD. World: x east, y north, z up <-> x north, y east, z down. Body:
// x forward, y left, z up <-> x forward, y right, z down. Every function is its own inverse.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace atmos {

// A vector in world axes.
inline Eigen::Vector3d swap_world(const Eigen::Vector3d& v) { return {v.y(), v.x(), -v.z()}; }
// A vector in body axes.
inline Eigen::Vector3d swap_body(const Eigen::Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }

// Attitude: body -> world, Hamilton.
inline Eigen::Quaterniond swap_attitude(const Eigen::Quaterniond& q) {
  static const Eigen::Quaterniond kWorld(0.0, std::sqrt(0.5), std::sqrt(0.5), 0.0), kBody(0.0, 1.0, 0.0, 0.0);
  return kWorld * q * kBody;
}

inline double swap_yaw(double yaw) { return std::remainder(M_PI_2 - yaw, 2.0 * M_PI); }

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Covariance of two vectors in world axes, one after the other.
inline Matrix6d swap_world_covariance(const Matrix6d& covariance) {
  Matrix6d S = Matrix6d::Zero();
  for (const int block : {0, 3})
    S(block, block + 1) = S(block + 1, block) = 1.0, S(block + 2, block + 2) = -1.0;
  return S * covariance * S.transpose();
}

// The same in body axes.
inline Matrix6d swap_body_covariance(const Matrix6d& covariance) {
  Matrix6d S = Matrix6d::Zero();
  S.diagonal() << 1.0, -1.0, -1.0, 1.0, -1.0, -1.0;
  return S * covariance * S.transpose();
}

}  // namespace atmos
