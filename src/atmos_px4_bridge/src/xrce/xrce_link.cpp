#include "atmos_px4_bridge/xrce/xrce_link.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "atmos_px4_bridge/frames.h"
#include "atmos_px4_bridge/px4_modes.h"

namespace atmos {

using namespace xrce;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kStampLimit_s = 1.0;  // a stamp further off is not of our clock: PX4 is not synchronised
constexpr std::uint8_t kPoseNed = 1, kVelocityBodyFrd = 3, kGoodQuality = 100;
constexpr std::uint8_t kComponentAutopilot = 1, kComponentOnboardComputer = 191, kArmed = 2;

std::uint64_t microseconds(double seconds) { return static_cast<std::uint64_t>(std::llround(seconds * 1e6)); }

F3 floats(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}
F4 floats(const Eigen::Quaterniond& q) {
  return {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()),
          static_cast<float>(q.z())};
}
Eigen::Vector3d vector(const F3& v) { return {v[0], v[1], v[2]}; }
float number_or_nan(double value) { return std::isfinite(value) ? static_cast<float>(value) : kNaN; }

}  // namespace

XrceLink::XrceLink(const XrceConfig& config, const Vehicle& vehicle, Write write, TelemetryListener listener)
    : config_(config),
      unit_(Allocator(vehicle).max_wrench()),
      thrusters_(vehicle.thrusters.size()),
      reversible_(vehicle.actuation != Actuation::kOnOff),
      listener_(std::move(listener)),
      endpoint_(config.firmware, config.baud / 10.0, std::move(write),
                {[this](double now_s) {
                   state_.reset();
                   has_angular_velocity_ = false;
                   time_sync_.reset();
                   if (listener_.reboot) listener_.reboot(now_s);
                 },
                 [this](Topic topic, ByteView payload, double now_s) { take_sample(topic, payload, now_s); },
                 [this](double remote_s, double now_s) { time_sync_.on_exchange(now_s, remote_s, now_s); },
                 [this](const std::string& fault) {
                   constexpr int kError = 3;
                   if (listener_.text) listener_.text(kError, "XRCE: " + fault);
                   if (listener_.refusal) listener_.refusal(fault);
                 }}) {}

LinkCounters XrceLink::counters() const {
  const EndpointCounters& c = endpoint_.counters();
  const FramingCounters& f = endpoint_.framing();
  return {c.sent, c.received, f.bad_crc + f.broken, c.lost, f.foreign, c.sessions > 0 ? c.sessions - 1 : 0};
}

LevelSupport XrceLink::support(Level level) const {
  using How = LevelSupport::How;
  switch (level) {
    case Level::kPosition:
      if (config_.firmware == xrce::Firmware::kPx4Space)
        return {How::kNatural,
                "TrajectorySetpoint with attitude; a velocity without a position pulls to the origin"};
      return {How::kNone,
              "this firmware's spacecraft controller does not listen to TrajectorySetpoint: not sent"};
    case Level::kAttitude:
      return {How::kNatural, "VehicleAttitudeSetpoint with thrust_body"};
    case Level::kRate:
      return {How::kNatural, "VehicleRatesSetpoint with thrust_body"};
    case Level::kWrench:
      return {How::kNatural, "VehicleThrustSetpoint and VehicleTorqueSetpoint"};
    case Level::kThrusters:
      if (thrusters_ > ActuatorMotors().control.size())
        return {How::kNone, "ActuatorMotors has twelve controls: not sent"};
      return {How::kNatural, "ActuatorMotors: one control per thruster"};
  }
  return {};
}

template <class Message>
void XrceLink::add(Samples& samples, Topic topic, const Message& message) const {
  samples.push_back({topic, encode(message, config_.firmware)});
}

bool XrceLink::offboard_confirmed(double now_s) const {
  return state_ && state_->mode == FlightMode::kOffboard && now_s - state_s_ <= kStatusLimit_s;
}

F3 XrceLink::thrust_body(const Eigen::Vector3d& force_B) const {
  const Eigen::Vector3d f = swap_body(force_B);
  return {static_cast<float>(std::clamp(f.x() / unit_[0], -1.0, 1.0)),
          static_cast<float>(std::clamp(f.y() / unit_[1], -1.0, 1.0)), 0.0f};
}

void XrceLink::fill_position(const Setpoint& setpoint, double now_s, Samples& samples) const {
  const Eigen::Vector3d p = swap_world(setpoint.p_WB), v = swap_world(setpoint.v_WB);
  TrajectorySetpoint message;
  message.timestamp = microseconds(now_s);
  message.position = {number_or_nan(p.x()), number_or_nan(p.y()), number_or_nan(p.z())};
  message.velocity = {number_or_nan(v.x()), number_or_nan(v.y()), number_or_nan(v.z())};
  message.acceleration.fill(kNaN);
  message.jerk.fill(kNaN);
  message.attitude.fill(kNaN);
  message.angular_velocity.fill(kNaN);
  message.yaw = kNaN;
  message.yawspeed = static_cast<float>(-setpoint.yaw_rate);
  if (std::isfinite(setpoint.yaw)) {
    message.yaw = static_cast<float>(swap_yaw(setpoint.yaw));
    message.attitude =
        floats(swap_attitude(Eigen::Quaterniond(Eigen::AngleAxisd(setpoint.yaw, Eigen::Vector3d::UnitZ()))));
  }
  add(samples, Topic::kTrajectorySetpoint, message);
}

void XrceLink::send_setpoint(const Setpoint& setpoint, const OdometrySample&, double now_s) {
  if (setpoint.level == Level::kThrusters) return send_actuators(setpoint.duty, now_s);
  const std::uint64_t now_us = microseconds(now_s);
  OffboardControlMode mode;
  mode.timestamp = now_us;
  mode.position = setpoint.level == Level::kPosition;
  mode.attitude = setpoint.level == Level::kAttitude;
  mode.body_rate = setpoint.level == Level::kRate;
  mode.thrust_and_torque = setpoint.level == Level::kWrench;
  Samples samples;
  add(samples, Topic::kOffboardControlMode, mode);
  if (!offboard_confirmed(now_s)) return endpoint_.send(Endpoint::Slot::kSetpoint, std::move(samples), now_s);
  switch (setpoint.level) {
    case Level::kPosition:
      fill_position(setpoint, now_s, samples);
      break;
    case Level::kAttitude: {
      VehicleAttitudeSetpoint message;
      message.timestamp = now_us;
      message.q_d = floats(swap_attitude(setpoint.q_WB));
      message.thrust_body = thrust_body(setpoint.force_B);
      add(samples, Topic::kAttitudeSetpoint, message);
      break;
    }
    case Level::kRate: {
      const Eigen::Vector3d w = swap_body(setpoint.w_WB_B);
      VehicleRatesSetpoint message;
      message.timestamp = now_us;
      message.roll = std::isfinite(w.x()) ? static_cast<float>(w.x()) : 0.0f;
      message.pitch = std::isfinite(w.y()) ? static_cast<float>(w.y()) : 0.0f;
      message.yaw = static_cast<float>(w.z());
      message.thrust_body = thrust_body(setpoint.force_B);
      add(samples, Topic::kRatesSetpoint, message);
      break;
    }
    case Level::kWrench: {
      // The thrust first: PX4 allocates when a torque comes.
      VehicleThrustSetpoint thrust;
      thrust.timestamp = thrust.timestamp_sample = now_us;
      thrust.xyz = thrust_body(setpoint.force_B);
      VehicleTorqueSetpoint torque;
      torque.timestamp = torque.timestamp_sample = now_us;
      torque.xyz[2] = static_cast<float>(std::clamp(swap_body(setpoint.torque_B).z() / unit_[2], -1.0, 1.0));
      add(samples, Topic::kThrustSetpoint, thrust);
      add(samples, Topic::kTorqueSetpoint, torque);
      break;
    }
    case Level::kThrusters:
      break;
  }
  endpoint_.send(Endpoint::Slot::kSetpoint, std::move(samples), now_s);
}

void XrceLink::send_actuators(const std::vector<double>& duty, double now_s) {
  OffboardControlMode mode;
  mode.timestamp = microseconds(now_s);
  mode.direct_actuator = true;
  Samples samples;
  add(samples, Topic::kOffboardControlMode, mode);
  if (offboard_confirmed(now_s)) {
    ActuatorMotors motors;
    motors.timestamp = motors.timestamp_sample = microseconds(now_s);
    motors.control.fill(kNaN);  // stopped: no thruster there
    const std::size_t count = std::min(duty.size(), motors.control.size());
    for (std::size_t i = 0; i < count; ++i) motors.control[i] = static_cast<float>(duty[i]);
    if (reversible_) motors.reversible_flags = static_cast<std::uint16_t>((1u << count) - 1);
    add(samples, Topic::kActuatorMotors, motors);
  }
  endpoint_.send(Endpoint::Slot::kSetpoint, std::move(samples), now_s);
}

void XrceLink::send_closed(double now_s) { send_actuators(std::vector<double>(thrusters_, 0.0), now_s); }

void XrceLink::send_odometry(const OdometrySample& odometry, double now_s) {
  const Matrix6d pose = swap_world_covariance(odometry.pose_covariance);
  const Matrix6d twist = swap_body_covariance(odometry.twist_covariance);
  VehicleOdometry message;
  message.timestamp = microseconds(now_s);
  message.timestamp_sample = microseconds(std::min(odometry.stamp_s, now_s));
  message.pose_frame = kPoseNed;
  message.position = floats(swap_world(odometry.p_WB));
  message.q = floats(swap_attitude(odometry.q_WB));
  message.velocity_frame = kVelocityBodyFrd;
  message.velocity = floats(swap_body(odometry.v_WB_B));
  message.angular_velocity = floats(swap_body(odometry.w_WB_B));
  message.position_variance = floats(Eigen::Vector3d(pose.diagonal().head<3>()));
  message.orientation_variance = floats(Eigen::Vector3d(pose.diagonal().tail<3>()));
  message.velocity_variance = floats(Eigen::Vector3d(twist.diagonal().head<3>()));
  message.quality = kGoodQuality;
  Samples samples;
  add(samples, Topic::kVisualOdometry, message);
  endpoint_.send(Endpoint::Slot::kOdometry, std::move(samples), now_s);
}

void XrceLink::send_command(std::uint32_t command, float param1, float param2, double now_s) {
  VehicleCommand message;
  message.timestamp = microseconds(now_s);
  message.command = command;
  message.param1 = param1;
  message.param2 = param2;
  message.target_system = config_.autopilot_system_id;
  message.target_component = kComponentAutopilot;
  message.source_system = config_.system_id;
  message.source_component = kComponentOnboardComputer;
  message.from_external = true;
  Samples samples;
  add(samples, Topic::kCommand, message);
  endpoint_.send(Endpoint::Slot::kCommand, std::move(samples), now_s);
}

void XrceLink::send_mode(FlightMode mode, double now_s) {
  asked_[kCommandSetMode] = std::string("mode ") + name_of(mode);
  send_command(kCommandSetMode, 1.0f, static_cast<float>(main_mode(mode)), now_s);
}

void XrceLink::send_arm(bool arm, bool force, double now_s) {
  asked_[kCommandArm] = arm ? "arm" : "disarm";
  send_command(kCommandArm, arm ? 1.0f : 0.0f, force ? kForceMagic : 0.0f, now_s);
}

double XrceLink::local_time(std::uint64_t stamp_us, double now_s) const {
  const double stamp_s = static_cast<double>(stamp_us) * 1e-6;
  return std::abs(now_s - stamp_s) < kStampLimit_s ? std::min(stamp_s, now_s) : now_s;
}

void XrceLink::on_status(const VehicleStatus& message, double now_s) {
  state_ = AutopilotState{message.arming_state == kArmed, mode_of_navigation_state(message.nav_state)};
  state_s_ = now_s;
  if (listener_.state) listener_.state(*state_);
}

void XrceLink::on_ack(const VehicleCommandAck& message) {
  if (message.result == kResultAccepted || message.result == kResultInProgress) return;
  const auto words = asked_.find(message.command);
  if (words != asked_.end() && listener_.refusal)
    listener_.refusal(words->second + ": " + command_result_text(message.result));
}

void XrceLink::take_sample(Topic topic, ByteView payload, double now_s) {
  // Until the firmware has shown itself nothing is believed.
  if (!endpoint_.verified()) return;
  if (listener_.heard) listener_.heard(now_s);
  const auto as = [&](auto message) {
    return decode(payload, config_.firmware, message) ? std::optional(message) : std::nullopt;
  };
  switch (topic) {
    case Topic::kStatus:
      if (const auto m = as(VehicleStatus())) on_status(*m, now_s);
      break;
    case Topic::kCommandAck:
      if (const auto m = as(VehicleCommandAck())) on_ack(*m);
      break;
    case Topic::kImu:
      if (const auto m = as(SensorCombined())) {
        const ImuReading reading{local_time(m->timestamp, now_s), swap_body(vector(m->accelerometer_m_s2)),
                                 swap_body(vector(m->gyro_rad))};
        // Releases of PX4 do not publish the angular velocity.
        if (!has_angular_velocity_) motion_.w_WB_B = reading.w_B;
        if (listener_.imu) listener_.imu(reading);
      }
      break;
    case Topic::kAngularVelocity:
      if (const auto m = as(VehicleAngularVelocity())) {
        has_angular_velocity_ = true;
        motion_.w_WB_B = swap_body(vector(m->xyz));
      }
      break;
    case Topic::kAttitude:
      if (const auto m = as(VehicleAttitude()))
        motion_.q_WB = swap_attitude(Eigen::Quaterniond(m->q[0], m->q[1], m->q[2], m->q[3]));
      break;
    case Topic::kLocalPosition:
      if (const auto m = as(VehicleLocalPosition())) {
        motion_.stamp_s = local_time(m->timestamp, now_s);
        motion_.p_WB = m->xy_valid ? swap_world({m->x, m->y, m->z}) : kNotControlled;
        motion_.v_WB = m->v_xy_valid ? swap_world({m->vx, m->vy, m->vz}) : kNotControlled;
        if (listener_.motion) listener_.motion(motion_);
      }
      break;
    case Topic::kBattery:
      if (const auto m = as(BatteryStatus())) {
        const auto known = [&](float value) {
          return m->connected && value >= 0.0f ? double{value} : double{kNaN};
        };
        if (listener_.battery)
          listener_.battery({known(m->voltage_v), known(m->current_a), known(m->remaining)});
      }
      break;
    case Topic::kTimesyncStatus:
      if (const auto m = as(TimesyncStatus())) round_trip_s_ = m->round_trip_time * 1e-6;
      break;
    default:
      break;
  }
}

}  // namespace atmos
