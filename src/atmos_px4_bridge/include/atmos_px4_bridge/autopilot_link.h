// What flying through an autopilot needs of a link to it, whatever the protocol. Implemented for MAVLink in
// mavlink/mavlink_link.h. World W is ENU, body B is FLU; times are ROS seconds.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>

#include "atmos_px4_bridge/setpoint.h"

namespace atmos {

// PX4's main modes.
enum class FlightMode { kUnknown, kManual, kAltitude, kPosition, kAuto, kAcro, kOffboard, kStabilized };

// "manual", "position", ...
const char* name_of(FlightMode mode);
// kUnknown for a name that is none.
FlightMode mode_named(const std::string& name);

struct AutopilotState {
  bool armed = false;
  FlightMode mode = FlightMode::kUnknown;
};

struct OdometrySample {
  double stamp_s = 0.0;
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
  Eigen::Vector3d v_WB_B = Eigen::Vector3d::Zero();
  Eigen::Vector3d w_WB_B = Eigen::Vector3d::Zero();
  // Pose: position and rotation in world axes; twist: linear and angular in body axes.
  Eigen::Matrix<double, 6, 6> pose_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> twist_covariance = Eigen::Matrix<double, 6, 6>::Zero();

  bool is_finite() const {
    return p_WB.allFinite() && q_WB.coeffs().allFinite() && v_WB_B.allFinite() && w_WB_B.allFinite();
  }
};

// How a level reaches the autopilot.
struct LevelSupport {
  enum class How { kNatural, kWorkAround, kNone } how = How::kNone;
  std::string statement;  // one sentence for people: which message, and what is lost
};

class AutopilotLink {
 public:
  virtual ~AutopilotLink() = default;
  virtual LevelSupport support(Level level) const = 0;
  // `measured`: the newest odometry, for levels that are translated into another.
  virtual void send_setpoint(const Setpoint& setpoint, const OdometrySample& measured, double now_s) = 0;
  // Whether the autopilot can be told to close the valves without disarming it.
  virtual bool can_close() const = 0;
  // Closed valves as a set-point; only if can_close().
  virtual void send_closed(double now_s) = 0;
  virtual void send_odometry(const OdometrySample& odometry, double now_s) = 0;
  virtual void send_mode(FlightMode mode, double now_s) = 0;
  // `force`: also in flight.
  virtual void send_arm(bool arm, bool force, double now_s) = 0;
};

}  // namespace atmos
