// What the emulated autopilot does with the topics of its uxrce_dds_client.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "atmos_px4_bridge/emulator/pixhawk_emulator.h"
#include "atmos_px4_bridge/emulator/uorb_messages.h"
#include "atmos_px4_bridge/frames.h"
#include "atmos_px4_bridge/px4_modes.h"

namespace atmos {

namespace {

using Topic = UxrceClient::Topic;

// The order is that of dds_topics.yaml.
const std::vector<Topic> kReaders = {{"register_ext_component_request", "RegisterExtComponentRequest"},
                                     {"unregister_ext_component", "UnregisterExtComponent"},
                                     {"config_overrides_request", "ConfigOverrides"},
                                     {"config_control_setpoints", "VehicleControlMode"},
                                     {"arming_check_reply", "ArmingCheckReply"},
                                     {"mode_completed", "ModeCompleted"},
                                     {"message_format_request", "MessageFormatRequest"},
                                     {"differential_drive_setpoint", "DifferentialDriveSetpoint"},
                                     {"offboard_control_mode", "OffboardControlMode"},
                                     {"onboard_computer_status", "OnboardComputerStatus"},
                                     {"obstacle_distance", "ObstacleDistance"},
                                     {"sensor_optical_flow", "SensorOpticalFlow"},
                                     {"goto_setpoint", "GotoSetpoint"},
                                     {"telemetry_status", "TelemetryStatus"},
                                     {"trajectory_setpoint", "TrajectorySetpoint"},
                                     {"vehicle_attitude_setpoint", "VehicleAttitudeSetpoint"},
                                     {"vehicle_mocap_odometry", "VehicleOdometry"},
                                     {"vehicle_rates_setpoint", "VehicleRatesSetpoint"},
                                     {"vehicle_visual_odometry", "VehicleOdometry"},
                                     {"vehicle_command", "VehicleCommand"},
                                     {"vehicle_command_mode_executor", "VehicleCommand"},
                                     {"vehicle_trajectory_bezier", "VehicleTrajectoryBezier"},
                                     {"vehicle_trajectory_waypoint", "VehicleTrajectoryWaypoint"},
                                     {"vehicle_thrust_setpoint", "VehicleThrustSetpoint"},
                                     {"vehicle_torque_setpoint", "VehicleTorqueSetpoint"},
                                     {"actuator_motors", "ActuatorMotors"},
                                     {"actuator_servos", "ActuatorServos"},
                                     {"aux_global_position", "VehicleGlobalPosition"}};

constexpr Topic kStatus{"vehicle_status", "VehicleStatus"}, kAttitude{"vehicle_attitude", "VehicleAttitude"},
    kAngularVelocity{"vehicle_angular_velocity", "VehicleAngularVelocity"},
    kLocalPosition{"vehicle_local_position", "VehicleLocalPosition"},
    kOdometry{"vehicle_odometry", "VehicleOdometry"}, kImu{"sensor_combined", "SensorCombined"},
    kBattery{"battery_status", "BatteryStatus"}, kTimesync{"timesync_status", "TimesyncStatus"},
    kAck{"vehicle_command_ack", "VehicleCommandAck"};

constexpr double kFast_s = 0.01, kSlow_s = 1.0, kStatus_s = 0.5;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::uint8_t navigation_state(FlightMode mode) {
  switch (mode) {
    case FlightMode::kAltitude:
      return 1;
    case FlightMode::kPosition:
      return 2;
    case FlightMode::kAcro:
      return 10;
    case FlightMode::kOffboard:
      return 14;
    case FlightMode::kStabilized:
      return 15;
    case FlightMode::kAuto:
      return 4;
    default:
      return 0;
  }
}

// As PX4 does it: without a look at the length.
template <class Message>
Message copied(const std::uint8_t* payload, std::size_t size) {
  Message message{};
  std::memcpy(&message, payload, std::min(size, Message::kWire));
  return message;
}

Eigen::Vector3d vector(const float (&v)[3]) { return {v[0], v[1], v[2]}; }
void fill(float (&out)[3], const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) out[i] = static_cast<float>(v[i]);
}
void fill(float (&out)[4], const Eigen::Quaterniond& q) {
  out[0] = static_cast<float>(q.w()), out[1] = static_cast<float>(q.x());
  out[2] = static_cast<float>(q.y()), out[3] = static_cast<float>(q.z());
}

}  // namespace

void PixhawkEmulator::start_xrce() {
  xrce_.emplace(UxrceClient::Config{kReaders, config_.clock_exchanges}, xrce_write_,
                [this](const std::string& topic, const std::uint8_t* payload, std::size_t size) {
                  on_uorb(topic, payload, size, receiving_s_);
                });
}

void PixhawkEmulator::receive_xrce(const std::uint8_t* data, std::size_t size, double now_s) {
  receiving_s_ = now_s;
  if (xrce_) xrce_->receive(data, size, clock(now_s));
}

// The level that the newest mode message names is what offboard mode carries out, once a set-point of it is
// there.
void PixhawkEmulator::take_uorb_setpoint(Level level, double now_s) {
  if (mode_ != FlightMode::kOffboard || uorb_level_ != level) ++stray_;
  if (uorb_level_ == level && now_s - offboard_s_ < config_.parameters["COM_OF_LOSS_T"])
    offboard_ = uorb_[level];
}

void PixhawkEmulator::on_uorb(const std::string& topic, const std::uint8_t* payload, std::size_t size,
                              double now_s) {
  if (topic == "offboard_control_mode") {
    const auto m = copied<uorb::OffboardControlMode>(payload, size);
    offboard_alive(now_s);
    uorb_level_ = m.position || m.velocity || m.acceleration ? Level::kPosition
                  : m.attitude                               ? Level::kAttitude
                  : m.body_rate                              ? Level::kRate
                  : m.thrust_and_torque                      ? Level::kWrench
                                                             : Level::kThrusters;
    if (uorb_.count(*uorb_level_) != 0) offboard_ = uorb_[*uorb_level_];
  } else if (topic == "actuator_motors") {
    const auto m = copied<uorb::ActuatorMotors>(payload, size);
    Setpoint& setpoint = uorb_[Level::kThrusters];
    setpoint.duty.assign(vehicle_.thrusters.size(), 0.0);
    for (std::size_t i = 0; i < std::min(std::size(m.control), setpoint.duty.size()); ++i) {
      const double least = (m.reversible_flags >> i & 1) != 0 ? -1.0 : 0.0;
      if (std::isfinite(m.control[i]))
        setpoint.duty[i] = std::clamp(static_cast<double>(m.control[i]), least, 1.0);
    }
    take_uorb_setpoint(Level::kThrusters, now_s);
  } else if (topic == "vehicle_thrust_setpoint") {
    uorb_[Level::kWrench].level = Level::kWrench;
    uorb_[Level::kWrench].force_B = swap_body(vector(copied<uorb::VectorSetpoint>(payload, size).xyz));
  } else if (topic == "vehicle_torque_setpoint") {  // what makes PX4 allocate
    uorb_[Level::kWrench].level = Level::kWrench;
    uorb_[Level::kWrench].torque_B = swap_body(vector(copied<uorb::VectorSetpoint>(payload, size).xyz));
    take_uorb_setpoint(Level::kWrench, now_s);
  } else if (topic == "vehicle_rates_setpoint") {
    const auto m = copied<uorb::RatesSetpoint>(payload, size);
    Setpoint& setpoint = uorb_[Level::kRate];
    setpoint.level = Level::kRate;
    setpoint.w_WB_B = swap_body({m.roll, m.pitch, m.yaw});
    setpoint.force_B = swap_body(vector(m.thrust_body));
    take_uorb_setpoint(Level::kRate, now_s);
  } else if (topic == "vehicle_attitude_setpoint") {
    const auto m = copied<uorb::AttitudeSetpoint>(payload, size);
    Setpoint& setpoint = uorb_[Level::kAttitude];
    setpoint.level = Level::kAttitude;
    setpoint.q_WB = swap_attitude({m.q_d[0], m.q_d[1], m.q_d[2], m.q_d[3]});
    setpoint.force_B = swap_body(vector(m.thrust_body));
    take_uorb_setpoint(Level::kAttitude, now_s);
  } else if (topic == "trajectory_setpoint") {
    const auto m = copied<uorb::TrajectorySetpoint>(payload, size);
    Setpoint& setpoint = uorb_[Level::kPosition];
    setpoint.level = Level::kPosition;
    // Its controller takes what is not a number for the origin.
    setpoint.p_WB = swap_world(vector(m.position).array().isFinite().select(vector(m.position), 0.0));
    setpoint.v_WB = swap_world(vector(m.velocity));
    // The yaw comes with the attitude alone.
    const Eigen::Quaterniond q = swap_attitude({m.attitude[0], m.attitude[1], m.attitude[2], m.attitude[3]});
    setpoint.yaw = 2.0 * std::atan2(q.z(), q.w());
    setpoint.yaw_rate = std::isfinite(setpoint.yaw) ? 0.0 : kNaN;
    take_uorb_setpoint(Level::kPosition, now_s);
  } else if (topic == "vehicle_visual_odometry") {
    const auto m = copied<uorb::VehicleOdometry>(payload, size);
    constexpr std::uint8_t kNed = 1, kBodyFrd = 3;
    if (m.pose_frame != kNed || m.velocity_frame != kBodyFrd) {
      ++ignored_;
      return;
    }
    const double clock_s = clock(now_s);
    const double sample_s = static_cast<double>(m.timestamp_sample) * 1e-6 - xrce_->agent_offset_s();
    estimator_.take_vision(std::min(sample_s, clock_s), clock_s, swap_world(vector(m.position)),
                           swap_attitude({m.q[0], m.q[1], m.q[2], m.q[3]}), swap_body(vector(m.velocity)));
  } else if (topic == "vehicle_command") {
    const auto m = copied<uorb::VehicleCommand>(payload, size);
    if (!for_us(m.target_system, m.target_component)) return;
    mavlink::CommandLong command;
    command.command = static_cast<std::uint16_t>(m.command);
    command.param1 = m.param1, command.param2 = m.param2, command.param3 = m.param3,
    command.param4 = m.param4;
    command.param5 = static_cast<float>(m.param5), command.param6 = static_cast<float>(m.param6);
    command.param7 = m.param7;
    uorb::VehicleCommandAck ack{};
    ack.command = m.command;
    ack.result = run_command(command, now_s);
    ack.target_system = m.source_system;
    ack.target_component = m.source_component;
    publish(kAck, ack, clock(now_s));
  }
}

std::uint64_t PixhawkEmulator::agent_us(double clock_s) const {
  return static_cast<std::uint64_t>(std::llround((clock_s + xrce_->agent_offset_s()) * 1e6));
}

template <class Message>
void PixhawkEmulator::publish(const Topic& topic, Message message, double clock_s) {
  message.timestamp = agent_us(clock_s);
  xrce_->publish(topic, &message, Message::kWire, clock_s);
}

// At PX4Space's rates: each update, at most 100 Hz.
void PixhawkEmulator::publish_all(double now_s) {
  const double clock_s = clock(now_s);
  xrce_->tick(clock_s);
  if (xrce_->phase() != UxrceClient::Phase::kRunning) {
    status_s_ = kNever;
    return;
  }
  const CascadeState state = estimator_.state(clock_s);
  const bool changed = status_armed_ != armed_ || status_mode_ != mode_;
  if (changed || now_s >= status_s_ + kStatus_s) {
    status_s_ = now_s, status_armed_ = armed_, status_mode_ = mode_;
    uorb::VehicleStatus m{};
    constexpr std::uint8_t kDisarmed = 1, kArmed = 2, kSpacecraft = 99;
    m.arming_state = armed_ ? kArmed : kDisarmed;
    m.nav_state = m.nav_state_user_intention = navigation_state(mode_);
    m.vehicle_type = kSpacecraft;
    publish(kStatus, m, clock_s);
  }
  if (now_s >= slow_s_ + kSlow_s) {
    slow_s_ = now_s;
    uorb::BatteryStatus battery{};
    battery.connected = true;
    battery.voltage_v = battery.voltage_filtered_v = static_cast<float>(voltage_v_);
    battery.current_a = battery.current_filtered_a = -1.0f;
    battery.remaining = static_cast<float>(charge_);
    publish(kBattery, battery, clock_s);
    uorb::TimesyncStatus sync{};
    sync.round_trip_time = static_cast<std::uint32_t>(xrce_->last_round_trip_s() * 1e6);
    publish(kTimesync, sync, clock_s);
  }
  if (now_s < published_s_ + kFast_s - 1e-6) return;
  published_s_ = now_s > published_s_ + 2.0 * kFast_s ? now_s : published_s_ + kFast_s;

  const bool valid = estimator_.valid(clock_s);
  const Eigen::Vector3d w = swap_body(gyro_B_);
  uorb::SensorCombined imu{};
  fill(imu.gyro_rad, w);
  fill(imu.accelerometer_m_s2, swap_body(acceleration_B_));
  publish(kImu, imu, clock_s);
  uorb::VehicleAngularVelocity rates{};
  fill(rates.xyz, w);
  publish(kAngularVelocity, rates, clock_s);
  const Eigen::Quaterniond q = valid ? swap_attitude(state.q_WB) : Eigen::Quaterniond::Identity();
  uorb::VehicleAttitude attitude{};
  fill(attitude.q, q);
  publish(kAttitude, attitude, clock_s);
  uorb::VehicleLocalPosition position{};
  uorb::VehicleOdometry odometry{};
  position.xy_valid = position.v_xy_valid = valid;
  if (valid) {
    const Eigen::Vector3d p = swap_world(state.p_WB), v = swap_world(state.v_WB);
    position.x = static_cast<float>(p.x()), position.y = static_cast<float>(p.y());
    position.z = static_cast<float>(p.z());
    position.vx = static_cast<float>(v.x()), position.vy = static_cast<float>(v.y());
    position.vz = static_cast<float>(v.z());
    fill(odometry.position, p);
    fill(odometry.velocity, v);
  }
  publish(kLocalPosition, position, clock_s);
  odometry.pose_frame = odometry.velocity_frame = 1;
  fill(odometry.q, q);
  fill(odometry.angular_velocity, w);
  publish(kOdometry, odometry, clock_s);
}

}  // namespace atmos
