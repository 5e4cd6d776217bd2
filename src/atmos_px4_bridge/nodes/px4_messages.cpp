#include "px4_messages.h"

#include <algorithm>

#include "atmos_model_ros/messages.h"

namespace atmos {

namespace {

template <class Message>
Eigen::Vector3d vector_from(const Message& m) {
  return {m.x, m.y, m.z};
}

Eigen::Quaterniond quaternion_from(const geometry_msgs::Quaternion& q) { return {q.w, q.x, q.y, q.z}; }

template <class Message>
void set(Message& out, const Eigen::Vector3d& v) {
  out.x = v.x(), out.y = v.y(), out.z = v.z();
}

void set(geometry_msgs::Quaternion& out, const Eigen::Quaterniond& q) {
  out.w = q.w(), out.x = q.x(), out.y = q.y(), out.z = q.z();
}

Eigen::Matrix<double, 6, 6> covariance_from(const boost::array<double, 36>& array) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(array.data());
}

}  // namespace

Setpoint setpoint_from(const atmos_msgs::ThrusterCommand& message) {
  Setpoint setpoint;
  setpoint.duty = message.duty;
  return setpoint;
}

Setpoint setpoint_from(const geometry_msgs::WrenchStamped& message) {
  Setpoint setpoint;
  setpoint.level = Level::kWrench;
  setpoint.force_B = vector_from(message.wrench.force);
  setpoint.torque_B = vector_from(message.wrench.torque);
  return setpoint;
}

Setpoint setpoint_from(const atmos_msgs::RateCommand& message) {
  Setpoint setpoint;
  setpoint.level = Level::kRate;
  setpoint.force_B = vector_from(message.force);
  setpoint.w_WB_B = vector_from(message.angular_rate);
  return setpoint;
}

Setpoint setpoint_from(const atmos_msgs::AttitudeCommand& message) {
  Setpoint setpoint;
  setpoint.level = Level::kAttitude;
  setpoint.force_B = vector_from(message.force);
  setpoint.q_WB = quaternion_from(message.attitude);
  return setpoint;
}

Setpoint setpoint_from(const geometry_msgs::PoseStamped& message) {
  Setpoint setpoint;
  setpoint.level = Level::kPosition;
  setpoint.p_WB.head<2>() = vector_from(message.pose.position).head<2>();
  setpoint.yaw = yaw_of(message.pose.orientation);
  return setpoint;
}

OdometrySample odometry_from(const nav_msgs::Odometry& message) {
  OdometrySample sample;
  sample.stamp_s = message.header.stamp.toSec();
  sample.p_WB = vector_from(message.pose.pose.position);
  sample.q_WB = quaternion_from(message.pose.pose.orientation);
  sample.v_WB_B = vector_from(message.twist.twist.linear);
  sample.w_WB_B = vector_from(message.twist.twist.angular);
  sample.pose_covariance = covariance_from(message.pose.covariance);
  sample.twist_covariance = covariance_from(message.twist.covariance);
  return sample;
}

atmos_msgs::AutopilotState state_message(const Px4Bridge& bridge, const Ports& ports, double now_s) {
  const FlightManagerStatus status = bridge.manager().status();
  atmos_msgs::AutopilotState message;
  message.header.stamp.fromSec(now_s);
  message.connected = status.connected;
  message.armed = status.autopilot.armed;
  message.mode = name_of(status.autopilot.mode);
  const TimeSync& sync =
      bridge.mavlink() != nullptr ? bridge.mavlink()->time_sync() : bridge.xrce()->time_sync();
  message.clock_offset = sync.offset_s();
  message.clock_skew = sync.skew();
  message.round_trip = bridge.mavlink() != nullptr ? sync.round_trip_s() : bridge.xrce()->round_trip_s();
  const auto add = [&message](const LinkCounters& counters, const Port& port) {
    message.sent += counters.sent;
    message.received += counters.received;
    message.lost += counters.lost;
    message.bad_checksum += counters.bad_crc;
    message.reboots += counters.reboots;
    message.dropped += port.counters().dropped_frames;
    message.opened += port.counters().opened;
  };
  if (bridge.mavlink() != nullptr) add(bridge.mavlink()->counters(), *ports.mavlink);
  if (bridge.xrce() != nullptr) add(bridge.xrce()->counters(), *ports.xrce);
  return message;
}

atmos_msgs::SupervisorStatus supervisor_message(const FlightManagerStatus& status, double now_s) {
  atmos_msgs::SupervisorStatus message;
  message.header.stamp.fromSec(now_s);
  message.state = static_cast<std::uint8_t>(status.state);
  message.rule = static_cast<std::uint8_t>(status.verdict.rule);
  message.text = status.verdict.text;
  message.refusal = status.refusal;
  message.setpoints = status.setpoints;
  message.malformed = status.malformed;
  message.unsupported = status.unsupported;
  message.odometry = status.odometry;
  return message;
}

sensor_msgs::Imu imu_message(const ImuReading& reading, const std::string& frame) {
  sensor_msgs::Imu message;
  message.header.stamp.fromSec(std::max(0.0, reading.stamp_s));
  message.header.frame_id = frame;
  message.orientation.w = 1.0;
  message.orientation_covariance[0] = -1.0;  // no orientation in this message
  set(message.angular_velocity, reading.w_B);
  set(message.linear_acceleration, reading.acceleration_B);
  return message;
}

sensor_msgs::BatteryState battery_message(const BatteryReading& reading, double now_s,
                                          const std::string& frame) {
  sensor_msgs::BatteryState message;
  message.header.stamp.fromSec(now_s);
  message.header.frame_id = frame;
  message.voltage = static_cast<float>(reading.voltage_v);
  message.current = static_cast<float>(-reading.current_a);
  message.percentage = static_cast<float>(reading.share);
  message.power_supply_status = sensor_msgs::BatteryState::POWER_SUPPLY_STATUS_DISCHARGING;
  message.power_supply_technology = sensor_msgs::BatteryState::POWER_SUPPLY_TECHNOLOGY_LIPO;
  message.present = true;
  return message;
}

nav_msgs::Odometry motion_message(const MotionEstimate& motion, const std::string& frame) {
  nav_msgs::Odometry message;
  message.header.stamp.fromSec(std::max(0.0, motion.stamp_s));
  message.header.frame_id = kWorldFrame;
  message.child_frame_id = frame;
  set(message.pose.pose.position, motion.p_WB);
  set(message.pose.pose.orientation, motion.q_WB);
  set(message.twist.twist.linear, motion.q_WB.conjugate() * motion.v_WB);
  set(message.twist.twist.angular, motion.w_WB_B);
  return message;
}

}  // namespace atmos
