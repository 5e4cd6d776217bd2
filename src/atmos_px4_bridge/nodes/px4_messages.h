// Conversion between ROS messages and the bridge's types.
#pragma once

#include <atmos_msgs/AttitudeCommand.h>
#include <atmos_msgs/AutopilotState.h>
#include <atmos_msgs/RateCommand.h>
#include <atmos_msgs/SupervisorStatus.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/BatteryState.h>
#include <sensor_msgs/Imu.h>

#include <memory>
#include <string>

#include "atmos_px4_bridge/port.h"
#include "atmos_px4_bridge/px4_bridge.h"

namespace atmos {

Setpoint setpoint_from(const atmos_msgs::ThrusterCommand& message);
Setpoint setpoint_from(const geometry_msgs::WrenchStamped& message);
Setpoint setpoint_from(const atmos_msgs::RateCommand& message);
Setpoint setpoint_from(const atmos_msgs::AttitudeCommand& message);
// The place and the yaw of a pose; the height is left alone.
Setpoint setpoint_from(const geometry_msgs::PoseStamped& message);
OdometrySample odometry_from(const nav_msgs::Odometry& message);

// By protocol; null when not used.
struct Ports {
  std::unique_ptr<Port> mavlink, xrce;
};

// Counters are sums over the links.
atmos_msgs::AutopilotState state_message(const Px4Bridge& bridge, const Ports& ports, double now_s);
atmos_msgs::SupervisorStatus supervisor_message(const FlightManagerStatus& status, double now_s);
sensor_msgs::Imu imu_message(const ImuReading& reading, const std::string& frame);
sensor_msgs::BatteryState battery_message(const BatteryReading& reading, double now_s,
                                          const std::string& frame);
nav_msgs::Odometry motion_message(const MotionEstimate& motion, const std::string& frame);

}  // namespace atmos
