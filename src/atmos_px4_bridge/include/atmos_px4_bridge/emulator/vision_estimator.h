// What the emulated autopilot knows of its motion: gyroscope and external vision, as EKF2 fuses them, reduced
// to the plane's needs. World ENU, body FLU; times are the autopilot's clock in seconds.
#pragma once

#include <limits>

#include "atmos_px4_bridge/cascade.h"

namespace atmos {

class VisionEstimator {
 public:
  static constexpr double kVisionLimit_s = 0.5;  // older vision: position, velocity and heading are not known

  // Moves on to `now_s` with the angular velocity that the gyroscope shows.
  void predict(double now_s, const Eigen::Vector3d& gyro_B);
  // Vision of the instant `stamp_s`; velocity in body axes.
  void take_vision(double stamp_s, double now_s, const Eigen::Vector3d& p_WB, const Eigen::Quaterniond& q_WB,
                   const Eigen::Vector3d& v_WB_B);

  bool valid(double now_s) const { return now_s - vision_s_ < kVisionLimit_s; }
  // With NaN where nothing is known.
  CascadeState state(double now_s) const;

 private:
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  double time_s_ = kNever, vision_s_ = kNever;
  Eigen::Vector3d p_WB_ = Eigen::Vector3d::Zero(), v_WB_ = Eigen::Vector3d::Zero(),
                  gyro_B_ = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_WB_ = Eigen::Quaterniond::Identity();
};

}  // namespace atmos
