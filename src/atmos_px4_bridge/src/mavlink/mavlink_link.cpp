#include "atmos_px4_bridge/mavlink/mavlink_link.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "atmos_px4_bridge/frames.h"
#include "atmos_px4_bridge/mavlink/px4.h"

namespace atmos {

using namespace mavlink;

namespace {

constexpr double kHeartbeatPeriod_s = 1.0, kTimesyncPeriod_s = 0.1, kStreamsPeriod_s = 5.0;
constexpr double kReboot_s = 0.5;  // the autopilot's clock runs back by more than this only when it starts
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// Telemetry asked for, Hz. What is not listed comes at PX4's own rates of the onboard mode.
constexpr struct {
  u32 id;
  double rate_hz;
} kStreams[] = {{HighresImu::kId, 50.0},     {AttitudeQuaternion::kId, 50.0}, {LocalPositionNed::kId, 30.0},
                {ServoOutputRaw::kId, 10.0}, {BatteryStatus::kId, 1.0},       {SysStatus::kId, 2.0}};

u64 microseconds(double seconds) { return static_cast<u64>(std::llround(seconds * 1e6)); }

Floats<4> floats(const Eigen::Quaterniond& q) {
  return {static_cast<f32>(q.w()), static_cast<f32>(q.x()), static_cast<f32>(q.y()), static_cast<f32>(q.z())};
}

Floats<21> upper_triangle(const Matrix6d& m) {
  Floats<21> out;
  std::size_t k = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) out[k++] = static_cast<f32>(m(row, column));
  }
  return out;
}

// PX4 sends whole numbers as the bits of the float.
double parameter_value(f32 value, u8 type) {
  if (type != kParameterInt32) return static_cast<double>(value);
  i32 whole;
  std::memcpy(&whole, &value, sizeof(whole));
  return whole;
}

f32 parameter_bits(double value, u8 type) {
  if (type != kParameterInt32) return static_cast<f32>(value);
  const i32 whole = static_cast<i32>(std::lround(value));
  f32 bits;
  std::memcpy(&bits, &whole, sizeof(bits));
  return bits;
}

}  // namespace

MavlinkLink::MavlinkLink(const MavlinkConfig& config, const Vehicle& vehicle, Write write,
                         TelemetryListener listener)
    : config_(config),
      unit_(Allocator(vehicle).max_wrench()),
      thrusters_(vehicle.thrusters.size()),
      write_(std::move(write)),
      listener_(std::move(listener)) {}

template <class Message>
void MavlinkLink::send(const Message& message) {
  u8 frame[kMaxFrame];
  const std::size_t size = encode(message, config_.own, sequence_++, frame);
  write_(frame, size);
  ++counters_.sent;
}

void MavlinkLink::send_command(u16 command, const std::vector<float>& parameters) {
  CommandLong message;
  f32* const out[] = {&message.param1, &message.param2, &message.param3, &message.param4,
                      &message.param5, &message.param6, &message.param7};
  for (std::size_t i = 0; i < parameters.size(); ++i) *out[i] = parameters[i];
  message.command = command;
  message.target_system = config_.autopilot.system;
  message.target_component = config_.autopilot.component;
  send(message);
}

u32 MavlinkLink::boot_ms(double now_s) const {
  return static_cast<u32>(std::llround((now_s - first_now_.value_or(now_s)) * 1e3));
}

LevelSupport MavlinkLink::support(Level level) const {
  using How = LevelSupport::How;
  const bool patched = config_.firmware == Firmware::kPatched;
  switch (level) {
    case Level::kPosition:
      return {How::kNatural, patched ? "SET_POSITION_TARGET_LOCAL_NED"
                                     : "SET_POSITION_TARGET_LOCAL_NED; stock firmware loses the yaw, and a "
                                       "velocity without a position pulls to the origin"};
    case Level::kAttitude:
      return {How::kNatural, "SET_ATTITUDE_TARGET with thrust_body"};
    case Level::kRate:
      if (patched) return {How::kNatural, "SET_ATTITUDE_TARGET with body rates and thrust_body"};
      return {
          How::kWorkAround,
          "stock firmware drops the thrust of a rate set-point: sent as SET_ATTITUDE_TARGET with an attitude "
          "that lies ahead by rate / SC_YAW_P, and thrust_body"};
    case Level::kWrench:
      if (patched) return {How::kNatural, "SET_ACTUATOR_CONTROL_TARGET, group 1: torque and thrust"};
      return {How::kNone, "stock firmware has no MAVLink message for it: not sent; use the rate level"};
    case Level::kThrusters:
      if (patched) return {How::kNatural, "SET_ACTUATOR_CONTROL_TARGET, group 0: one control per thruster"};
      return {How::kNone, "stock firmware has no MAVLink message for it: not sent; use the rate level"};
  }
  return {};
}

Floats<3> MavlinkLink::thrust_body(const Eigen::Vector3d& force_B) const {
  const Eigen::Vector3d f = swap_body(force_B);
  return {static_cast<f32>(std::clamp(f.x() / unit_[0], -1.0, 1.0)),
          static_cast<f32>(std::clamp(f.y() / unit_[1], -1.0, 1.0)), 0.0f};
}

void MavlinkLink::send_attitude(const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& force_B,
                                double now_s) {
  SetAttitudeTarget message;
  message.time_boot_ms = boot_ms(now_s);
  message.target_system = config_.autopilot.system;
  message.target_component = config_.autopilot.component;
  message.type_mask = kThrustBodySet | kIgnoreBodyRates;
  message.q = floats(swap_attitude(q_WB));
  message.thrust_body = thrust_body(force_B);
  send(message);
}

void MavlinkLink::send_actuators(u8 group, const std::vector<double>& controls, double now_s) {
  SetActuatorControlTarget message;
  message.time_usec = microseconds(now_s);
  message.group_mlx = group;
  message.target_system = config_.autopilot.system;
  message.target_component = config_.autopilot.component;
  for (std::size_t i = 0; i < std::min(controls.size(), message.controls.size()); ++i)
    message.controls[i] = static_cast<f32>(controls[i]);
  send(message);
}

void MavlinkLink::send_setpoint(const Setpoint& setpoint, const OdometrySample& measured, double now_s) {
  switch (setpoint.level) {
    case Level::kPosition: {
      const Eigen::Vector3d p = swap_world(setpoint.p_WB), v = swap_world(setpoint.v_WB);
      SetPositionTargetLocalNed message;
      message.time_boot_ms = boot_ms(now_s);
      message.coordinate_frame = kFrameLocalNed;
      message.target_system = config_.autopilot.system;
      message.target_component = config_.autopilot.component;
      message.type_mask = kIgnoreAcceleration;
      f32* const positions[] = {&message.x, &message.y, &message.z};
      f32* const velocities[] = {&message.vx, &message.vy, &message.vz};
      for (int i = 0; i < 3; ++i) {
        if (std::isfinite(p[i]))
          *positions[i] = static_cast<f32>(p[i]);
        else
          message.type_mask |= static_cast<u16>(kIgnorePosition << i);
        if (std::isfinite(v[i]))
          *velocities[i] = static_cast<f32>(v[i]);
        else
          message.type_mask |= static_cast<u16>(kIgnoreVelocity << i);
      }
      if (std::isfinite(setpoint.yaw))
        message.yaw = static_cast<f32>(swap_yaw(setpoint.yaw));
      else
        message.type_mask |= kIgnoreYaw;
      message.yaw_rate = static_cast<f32>(-setpoint.yaw_rate);
      send(message);
      return;
    }
    case Level::kAttitude:
      return send_attitude(setpoint.q_WB, setpoint.force_B, now_s);
    case Level::kRate: {
      if (config_.firmware == Firmware::kStock) {
        // PX4's attitude loop asks for P 2 vec(q_e): an attitude that is ahead by the angle whose sine gives
        // it.
        const double ahead =
            2.0 * std::asin(std::clamp(0.5 * setpoint.w_WB_B.z() / config_.attitude_p, -1.0, 1.0));
        const Eigen::Quaterniond turn(Eigen::AngleAxisd(ahead, Eigen::Vector3d::UnitZ()));
        return send_attitude(measured.q_WB * turn, setpoint.force_B, now_s);
      }
      const Eigen::Vector3d w = swap_body(setpoint.w_WB_B);
      SetAttitudeTarget message;
      message.time_boot_ms = boot_ms(now_s);
      message.target_system = config_.autopilot.system;
      message.target_component = config_.autopilot.component;
      message.type_mask = kThrustBodySet | kIgnoreAttitude;
      message.q = {1.0f, 0.0f, 0.0f, 0.0f};
      message.body_roll_rate = std::isfinite(w.x()) ? static_cast<f32>(w.x()) : 0.0f;
      message.body_pitch_rate = std::isfinite(w.y()) ? static_cast<f32>(w.y()) : 0.0f;
      message.body_yaw_rate = static_cast<f32>(w.z());
      message.thrust_body = thrust_body(setpoint.force_B);
      send(message);
      return;
    }
    case Level::kWrench: {
      const Eigen::Vector3d torque = swap_body(setpoint.torque_B), force = swap_body(setpoint.force_B);
      return send_actuators(
          kGroupWrench, {0.0, 0.0, torque.z() / unit_[2], force.x() / unit_[0], force.y() / unit_[1], 0.0},
          now_s);
    }
    case Level::kThrusters:
      return send_actuators(kGroupThrusters, setpoint.duty, now_s);
  }
}

void MavlinkLink::send_closed(double now_s) {
  send_actuators(kGroupThrusters, std::vector<double>(thrusters_, 0.0), now_s);
}

void MavlinkLink::send_odometry(const OdometrySample& odometry, double now_s) {
  const Eigen::Vector3d p = swap_world(odometry.p_WB), v = swap_body(odometry.v_WB_B),
                        w = swap_body(odometry.w_WB_B);
  Odometry message;
  // PX4 takes it as a time of our clock and maps it by TIMESYNC.
  message.time_usec = microseconds(std::min(odometry.stamp_s, now_s));
  message.frame_id = kFrameLocalNed;
  message.child_frame_id = kFrameBodyFrd;
  message.estimator_type = kEstimatorVision;
  message.x = static_cast<f32>(p.x()), message.y = static_cast<f32>(p.y()),
  message.z = static_cast<f32>(p.z());
  message.q = floats(swap_attitude(odometry.q_WB));
  message.vx = static_cast<f32>(v.x()), message.vy = static_cast<f32>(v.y()),
  message.vz = static_cast<f32>(v.z());
  message.rollspeed = static_cast<f32>(w.x());
  message.pitchspeed = static_cast<f32>(w.y());
  message.yawspeed = static_cast<f32>(w.z());
  message.pose_covariance = upper_triangle(swap_world_covariance(odometry.pose_covariance));
  message.velocity_covariance = upper_triangle(swap_body_covariance(odometry.twist_covariance));
  send(message);
}

void MavlinkLink::send_mode(FlightMode mode, double) {
  asked_[kCommandSetMode] = std::string("mode ") + name_of(mode);
  send_command(kCommandSetMode, {1.0f, static_cast<float>(main_mode(mode))});
}

void MavlinkLink::send_arm(bool arm, bool force, double) {
  asked_[kCommandArm] = arm ? "arm" : "disarm";
  send_command(kCommandArm, {arm ? 1.0f : 0.0f, force ? kForceMagic : 0.0f});
}

void MavlinkLink::request_parameter(const std::string& name) {
  ParamRequestRead message;
  message.target_system = config_.autopilot.system;
  message.target_component = config_.autopilot.component;
  message.param_index = -1;
  message.param_id = Text<16>(name);
  send(message);
}

void MavlinkLink::set_parameter(const Parameter& parameter) {
  ParamSet message;
  message.target_system = config_.autopilot.system;
  message.target_component = config_.autopilot.component;
  message.param_id = Text<16>(parameter.name);
  message.param_type = parameter.type;
  message.param_value = parameter_bits(parameter.value, parameter.type);
  send(message);
}

void MavlinkLink::send_actuator_test(int thruster, double share, double duration_s) {
  constexpr float kMotor1 = 1.0f;  // ACTUATOR_OUTPUT_FUNCTION_MOTOR1
  asked_[kCommandActuatorTest] = "test of thruster " + std::to_string(thruster);
  send_command(kCommandActuatorTest, {static_cast<float>(share), static_cast<float>(duration_s), 0.0f, 0.0f,
                                      kMotor1 + static_cast<float>(thruster - 1)});
}

void MavlinkLink::restart() {
  parser_.reset();
  last_sequence_.reset();
  streams_s_.reset();
}

void MavlinkLink::tick(double now_s) {
  if (!first_now_) first_now_ = now_s;
  const auto due = [now_s](std::optional<double>& last, double period) {
    if (last && now_s - *last < period - 1e-6 && now_s >= *last) return false;
    last = now_s;
    return true;
  };
  if (due(heartbeat_s_, kHeartbeatPeriod_s)) {
    Heartbeat message;
    message.type = kTypeOnboardController;
    message.autopilot = kAutopilotInvalid;
    message.system_status = kStateActive;
    message.mavlink_version = 3;
    send(message);
  }
  if (due(timesync_s_, kTimesyncPeriod_s)) {
    Timesync message;
    message.ts1 = std::llround(now_s * 1e9);
    send(message);
  }
  if (due(streams_s_, kStreamsPeriod_s)) {
    for (const auto& stream : kStreams)
      send_command(kCommandMessageInterval,
                   {static_cast<float>(stream.id), static_cast<float>(1e6 / stream.rate_hz)});
  }
}

void MavlinkLink::receive(const u8* data, std::size_t size, double now_s) {
  if (!first_now_) first_now_ = now_s;
  parser_.push(data, size);
  while (const auto frame = parser_.next()) {
    if (frame->from.system != config_.autopilot.system ||
        frame->from.component != config_.autopilot.component) {
      ++counters_.foreign;
      continue;
    }
    if (last_sequence_) counters_.lost += static_cast<u8>(frame->sequence - *last_sequence_ - 1);
    last_sequence_ = frame->sequence;
    ++counters_.received;
    if (listener_.heard) listener_.heard(now_s);
    dispatch(*frame, now_s);
  }
  counters_.bad_crc = parser_.counters().bad_crc;
}

double MavlinkLink::local_time(double remote_s, double now_s) const {
  const auto local = time_sync_.to_local(remote_s);
  return local ? std::min(*local, now_s) : now_s;
}

void MavlinkLink::notice_remote_time(double remote_s, double now_s) {
  if (remote_s_ && remote_s < *remote_s_ - kReboot_s) {
    ++counters_.reboots;
    time_sync_.reset();
    streams_s_.reset();
    if (listener_.reboot) listener_.reboot(now_s);
  }
  remote_s_ = remote_s;
}

void MavlinkLink::on_timesync(const Timesync& message, double now_s) {
  if (message.tc1 == 0) {
    notice_remote_time(static_cast<double>(message.ts1) * 1e-9, now_s);
    Timesync reply;
    reply.tc1 = std::llround(now_s * 1e9);
    reply.ts1 = message.ts1;
    send(reply);
    return;
  }
  const double sent = static_cast<double>(message.ts1) * 1e-9;
  if (sent > now_s + 1e-3 || sent < now_s - 1.0) return;  // nobody's answer to us, or of another life
  const double remote = static_cast<double>(message.tc1) * 1e-9;
  notice_remote_time(remote, now_s);
  time_sync_.on_exchange(sent, remote, now_s);
}

void MavlinkLink::dispatch(const Frame& frame, double now_s) {
  const auto call = [](const auto& function, const auto& argument) {
    if (function) function(argument);
  };
  if (const auto m = decode<Heartbeat>(frame)) {
    call(listener_.state,
         AutopilotState{(m->base_mode & kFlagArmed) != 0, mode_of(static_cast<u8>(m->custom_mode >> 16))});
  } else if (const auto m = decode<Timesync>(frame)) {
    on_timesync(*m, now_s);
  } else if (const auto m = decode<CommandAck>(frame)) {
    if (m->result != kResultAccepted && asked_.count(m->command))
      call(listener_.refusal, asked_[m->command] + ": " + command_result_text(m->result));
  } else if (const auto m = decode<HighresImu>(frame)) {
    call(listener_.imu,
         ImuReading{local_time(static_cast<double>(m->time_usec) * 1e-6, now_s),
                    swap_body({m->xacc, m->yacc, m->zacc}), swap_body({m->xgyro, m->ygyro, m->zgyro})});
  } else if (const auto m = decode<AttitudeQuaternion>(frame)) {
    motion_.q_WB = swap_attitude(Eigen::Quaterniond(m->q1, m->q2, m->q3, m->q4));
    motion_.w_WB_B = swap_body({m->rollspeed, m->pitchspeed, m->yawspeed});
  } else if (const auto m = decode<LocalPositionNed>(frame)) {
    motion_.stamp_s = local_time(m->time_boot_ms * 1e-3, now_s);
    motion_.p_WB = swap_world({m->x, m->y, m->z});
    motion_.v_WB = swap_world({m->vx, m->vy, m->vz});
    call(listener_.motion, motion_);
  } else if (const auto m = decode<BatteryStatus>(frame)) {
    constexpr u16 kNoCell = 0xFFFF;
    double voltage = 0.0;
    for (const u16 cell : m->voltages) voltage += cell == kNoCell ? 0.0 : cell * 1e-3;
    call(listener_.battery,
         BatteryReading{voltage, m->current_battery < 0 ? double{kNaN} : m->current_battery * 1e-2,
                        m->battery_remaining < 0 ? double{kNaN} : m->battery_remaining * 1e-2});
  } else if (const auto m = decode<ServoOutputRaw>(frame)) {
    const u16 raw[] = {m->servo1_raw,  m->servo2_raw,  m->servo3_raw,  m->servo4_raw,
                       m->servo5_raw,  m->servo6_raw,  m->servo7_raw,  m->servo8_raw,
                       m->servo9_raw,  m->servo10_raw, m->servo11_raw, m->servo12_raw,
                       m->servo13_raw, m->servo14_raw, m->servo15_raw, m->servo16_raw};
    // The microseconds since boot of this message overflow after 71 minutes: the rest is that of the clock.
    constexpr double kWrap = 4294.967296;
    const double remote = m->time_usec * 1e-6;
    const double turns = remote_s_ ? std::round((*remote_s_ - remote) / kWrap) : 0.0;
    // Of a period that may not have begun yet.
    ActuatorReading reading{time_sync_.to_local(remote + turns * kWrap).value_or(now_s), {}};
    for (std::size_t i = 0; i < std::min(thrusters_, std::size(raw)); ++i)
      reading.duty.push_back(std::min(1.0, raw[i] / kTicksPerPeriod));
    call(listener_.actuators, reading);
  } else if (const auto m = decode<Statustext>(frame)) {
    if (listener_.text) listener_.text(m->severity, m->text.str());
  } else if (const auto m = decode<ParamValue>(frame)) {
    call(listener_.parameter,
         Parameter{m->param_id.str(), parameter_value(m->param_value, m->param_type), m->param_type});
  }
}

}  // namespace atmos
