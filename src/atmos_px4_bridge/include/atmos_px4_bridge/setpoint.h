// Set-points of every level of the paper, whatever carries them to the autopilot. World W is ENU, body B is
// FLU; forces in N and torques in N m about the geometric centre.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <vector>

namespace atmos {

// From the outermost loop inwards: an autopilot closes all loops from the named one on.
enum class Level { kPosition, kAttitude, kRate, kWrench, kThrusters };

// "position", "attitude", "rate", "wrench", "thrusters".
const char* name_of(Level level);

inline const Eigen::Vector3d kNotControlled =
    Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());

// Not-a-number leaves an axis to itself: nothing is commanded along it.
struct Setpoint {
  Level level = Level::kThrusters;
  // kPosition. Where the position of an axis is NaN its velocity is controlled; both NaN: neither.
  Eigen::Vector3d p_WB = kNotControlled;  // m
  Eigen::Vector3d v_WB = kNotControlled;  // m/s; feed-forward where the position is controlled, NaN: none
  double yaw = std::numeric_limits<double>::quiet_NaN();  // rad; NaN: yaw_rate alone
  double yaw_rate = 0.0;                                  // rad/s, feed-forward with a yaw
  // kAttitude.
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
  // kRate.
  Eigen::Vector3d w_WB_B = kNotControlled;  // rad/s
  // kAttitude, kRate, kWrench.
  Eigen::Vector3d force_B = Eigen::Vector3d::Zero();  // N
  // kWrench.
  Eigen::Vector3d torque_B = Eigen::Vector3d::Zero();  // N m
  // kThrusters: one per thruster, [0, 1]; propellers [-1, 1].
  std::vector<double> duty;
};

}  // namespace atmos
