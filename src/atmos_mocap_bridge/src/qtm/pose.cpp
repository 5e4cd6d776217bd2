#include "atmos_mocap_bridge/qtm/pose.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace atmos::qtm {

namespace {

constexpr double kMillimetre = 1e-3;
constexpr float kRotationTolerance = 1e-2f;  // of R^T R: far above the rounding of floats

}  // namespace

PoseFrame to_pose_frame(const Body& body, double stamp_s) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  PoseFrame frame{stamp_s, Eigen::Vector3d::Constant(nan), Eigen::Quaterniond(nan, nan, nan, nan)};
  const Eigen::Map<const Eigen::Matrix3f> rotation(body.rotation.data());
  const bool is_rotation = (rotation.transpose() * rotation).isIdentity(kRotationTolerance) &&
                           rotation.determinant() > 0.0f;  // false for not-a-number too
  if (!is_rotation) return frame;
  frame.p_WB = kMillimetre * Eigen::Map<const Eigen::Vector3f>(body.position_mm.data()).cast<double>();
  frame.q_WB = Eigen::Quaterniond(rotation.cast<double>()).normalized();
  return frame;
}

Body to_body(const PoseFrame& frame) {
  Body body;
  Eigen::Map<Eigen::Vector3f>(body.position_mm.data()) = (frame.p_WB / kMillimetre).cast<float>();
  Eigen::Map<Eigen::Matrix3f>(body.rotation.data()) = frame.q_WB.toRotationMatrix().cast<float>();
  body.residual_mm = 0.0f;
  if (!frame.p_WB.allFinite() || !frame.q_WB.coeffs().allFinite()) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    body.position_mm.fill(nan);
    body.rotation.fill(nan);
    body.residual_mm = nan;
  }
  return body;
}

}  // namespace atmos::qtm
