// What an autopilot tells over a link, whatever the protocol, in our frames and units. Stamps are ROS seconds
// (the time of arrival until clocks are matched).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "atmos_px4_bridge/autopilot_link.h"

namespace atmos {

struct ImuReading {
  double stamp_s;
  Eigen::Vector3d acceleration_B, w_B;  // m/s^2, rad/s
};
struct MotionEstimate {  // of the autopilot's own estimator
  double stamp_s = 0.0;
  Eigen::Vector3d p_WB = kNotControlled, v_WB = kNotControlled;
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
  Eigen::Vector3d w_WB_B = Eigen::Vector3d::Zero();
};
struct BatteryReading {
  double voltage_v, current_a, share;  // NaN: not measured
};
struct ActuatorReading {
  double stamp_s;
  std::vector<double> duty;
};
struct Parameter {
  std::string name;
  double value;
  std::uint8_t type;  // as the protocol numbers it
};

// Called while bytes are taken in. What is empty is not called.
struct TelemetryListener {
  std::function<void(double)> heard;  // anything intelligible, at a time
  std::function<void(const AutopilotState&)> state;
  std::function<void(double)> reboot;  // the autopilot, or its end of the link, started anew
  std::function<void(const std::string&)> refusal;
  std::function<void(const ImuReading&)> imu;
  std::function<void(const MotionEstimate&)> motion;
  std::function<void(const BatteryReading&)> battery;
  std::function<void(const ActuatorReading&)> actuators;
  std::function<void(int, const std::string&)> text;  // severity 0 (emergency) to 7 (debug)
  std::function<void(const Parameter&)> parameter;
};

struct LinkCounters {
  std::uint64_t sent = 0, received = 0, bad_crc = 0, lost = 0, foreign = 0, reboots = 0;
};

}  // namespace atmos
