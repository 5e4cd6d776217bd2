#include "atmos_px4_bridge/emulator/vision_estimator.h"

#include <algorithm>

namespace atmos {

namespace {

constexpr double kPositionGain = 0.5, kVelocityGain = 0.3, kAttitudeGain = 0.2;  // per vision sample
constexpr double kMaxStep = 0.1;                                                 // s

Eigen::Quaterniond turned(const Eigen::Quaterniond& q, const Eigen::Vector3d& angle_B) {
  const double angle = angle_B.norm();
  if (angle < 1e-12) return q;
  return (q * Eigen::Quaterniond(Eigen::AngleAxisd(angle, angle_B / angle))).normalized();
}

}  // namespace

void VisionEstimator::predict(double now_s, const Eigen::Vector3d& gyro_B) {
  const double dt = std::clamp(now_s - time_s_, 0.0, kMaxStep);
  time_s_ = now_s;
  gyro_B_ = gyro_B;
  p_WB_ += v_WB_ * dt;
  q_WB_ = turned(q_WB_, gyro_B * dt);
}

void VisionEstimator::take_vision(double stamp_s, double now_s, const Eigen::Vector3d& p_WB,
                                  const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& v_WB_B) {
  const double age = std::clamp(now_s - stamp_s, 0.0, kMaxStep);
  const Eigen::Vector3d v_W = q_WB * v_WB_B, p_W = p_WB + v_W * age;
  const Eigen::Quaterniond q = turned(q_WB.normalized(), gyro_B_ * age);
  if (!valid(now_s)) {
    p_WB_ = p_W, v_WB_ = v_W, q_WB_ = q;
  } else {
    p_WB_ += kPositionGain * (p_W - p_WB_);
    v_WB_ += kVelocityGain * (v_W - v_WB_);
    q_WB_ = q_WB_.slerp(kAttitudeGain, q);
  }
  vision_s_ = std::max(vision_s_, std::min(stamp_s, now_s));
}

CascadeState VisionEstimator::state(double now_s) const {
  CascadeState state;
  state.w_WB_B = gyro_B_;
  if (!valid(now_s)) return state;
  state.p_WB = p_WB_, state.v_WB = v_WB_, state.q_WB = q_WB_;
  return state;
}

}  // namespace atmos
