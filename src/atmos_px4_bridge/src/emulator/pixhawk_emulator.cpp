#include "atmos_px4_bridge/emulator/pixhawk_emulator.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "atmos_px4_bridge/frames.h"
#include "atmos_px4_bridge/mavlink/px4.h"

namespace atmos {

using namespace mavlink;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kStreamFirst_s = 1.0, kStreamGap_s = 0.5;  // offboard: set-points at 2 Hz for a second
constexpr double kAcroGain = 5.0;                           // rad/s per stick
constexpr double kStickDeadZone = 0.02;
constexpr double kHoldSpeed = 0.02;  // m/s: slow enough to hold the place
constexpr double kTestLimit_s = 3.0;
constexpr int kActionManual = 2, kActionPosition = 0;  // of COM_OBL_RC_ACT; every other one disarms here
constexpr u8 kCritical = 2, kWarning = 4, kInfo = 6;   // severities

double stick(i16 value) {
  const double share = std::clamp(value / 1000.0, -1.0, 1.0);
  return std::abs(share) < kStickDeadZone ? 0.0 : share;
}

double yaw_of(const Eigen::Quaterniond& q) {
  return std::atan2(2.0 * (q.w() * q.z() + q.x() * q.y()), 1.0 - 2.0 * (q.y() * q.y() + q.z() * q.z()));
}

// PX4's rates of the onboard mode, Hz.
const std::map<u32, double> kRates = {
    {Heartbeat::kId, 1.0},           {Timesync::kId, 10.0},         {HighresImu::kId, 50.0},
    {AttitudeQuaternion::kId, 50.0}, {LocalPositionNed::kId, 30.0}, {SysStatus::kId, 5.0},
    {BatteryStatus::kId, 0.5},       {ExtendedSysState::kId, 5.0},  {EstimatorStatus::kId, 1.0}};

}  // namespace

PixhawkEmulator::PixhawkEmulator(const PixhawkConfig& config, const Vehicle& vehicle, Write write,
                                 double now_s, Write xrce)
    : config_(config),
      vehicle_(vehicle),
      write_(std::move(write)),
      boot_s_(now_s),
      cascade_(vehicle, config.parameters.gains(), Units::kNormalised),
      duty_(vehicle.thrusters.size(), 0.0),
      xrce_write_(std::move(xrce)) {
  next_edge_s_ = std::ceil((now_s - config_.pwm_phase_s) / vehicle_.pwm.period_s) * vehicle_.pwm.period_s +
                 config_.pwm_phase_s;
  for (const auto& [id, rate] : kRates) interval_s_[id] = 1.0 / rate;
  if (xrce_write_) start_xrce();
}

ThrusterCommand PixhawkEmulator::reboot(double now_s) {
  const PixhawkConfig config = config_;
  *this = PixhawkEmulator(config, vehicle_, write_, now_s, xrce_write_);
  if (xrce_) start_xrce();  // its callbacks name this object
  return {now_s, vehicle_.pwm.period_s, std::vector<double>(vehicle_.thrusters.size(), 0.0)};
}

template <class Message>
void PixhawkEmulator::send(const Message& message) {
  u8 frame[kMaxFrame];
  const Address own{static_cast<u8>(config_.parameters["MAV_SYS_ID"]), kComponentAutopilot};
  write_(frame, encode(message, own, sequence_++, frame));
}

void PixhawkEmulator::say(u8 severity, const std::string& text) {
  Statustext message;
  message.severity = severity;
  message.text = Text<50>(text);
  send(message);
}

bool PixhawkEmulator::for_us(u8 system, u8 component) const {
  return (system == 0 || system == static_cast<u8>(config_.parameters["MAV_SYS_ID"])) &&
         (component == 0 || component == kComponentAutopilot);
}

void PixhawkEmulator::receive(const u8* data, std::size_t size, double now_s) {
  parser_.push(data, size);
  while (const auto frame = parser_.next()) dispatch(*frame, now_s);
}

void PixhawkEmulator::sense(const Eigen::Vector3d& gyro_B, const Eigen::Vector3d& acceleration_B) {
  gyro_B_ = gyro_B;
  acceleration_B_ = acceleration_B;
}

void PixhawkEmulator::dispatch(const Frame& frame, double now_s) {
  if (const auto m = decode<mavlink::Odometry>(frame)) {
    on_odometry(*m, now_s);
  } else if (const auto m = decode<SetAttitudeTarget>(frame)) {
    if (for_us(m->target_system, m->target_component)) on_attitude_target(*m, now_s);
  } else if (const auto m = decode<SetPositionTargetLocalNed>(frame)) {
    if (for_us(m->target_system, m->target_component)) on_position_target(*m, now_s);
  } else if (const auto m = decode<SetActuatorControlTarget>(frame)) {
    if (for_us(m->target_system, m->target_component)) on_actuator_controls(*m, now_s);
  } else if (const auto m = decode<Timesync>(frame)) {
    const i64 clock_ns = std::llround(clock(now_s) * 1e9);
    if (m->tc1 == 0) {
      Timesync reply;
      reply.tc1 = clock_ns;
      reply.ts1 = m->ts1;
      send(reply);
    } else {
      clock_offset_ = static_cast<double>(m->tc1 - clock_ns) * 1e-9;
    }
  } else if (const auto m = decode<CommandLong>(frame)) {
    if (!for_us(m->target_system, m->target_component)) return;
    CommandAck ack;
    ack.command = m->command;
    ack.result = run_command(*m, now_s);
    ack.target_system = frame.from.system;
    ack.target_component = frame.from.component;
    send(ack);
  } else if (const auto m = decode<SetMode>(frame)) {
    if (for_us(m->target_system, 0)) set_mode(mode_of(static_cast<u8>(m->custom_mode >> 16)), now_s);
  } else if (const auto m = decode<ManualControl>(frame)) {
    sticks_ = *m;
    sticks_s_ = now_s;
  } else if (const auto m = decode<ParamRequestRead>(frame)) {
    if (for_us(m->target_system, m->target_component)) report_parameter(m->param_id.str());
  } else if (const auto m = decode<ParamSet>(frame)) {
    if (!for_us(m->target_system, m->target_component)) return;
    const std::string name = m->param_id.str();
    double value = static_cast<double>(m->param_value);
    if (m->param_type == kParameterInt32) {
      i32 whole;
      std::memcpy(&whole, &m->param_value, sizeof(whole));
      value = whole;
    }
    if (config_.parameters.set(name, value)) {
      cascade_ = Cascade(vehicle_, config_.parameters.gains(), Units::kNormalised);
      report_parameter(name);
    }
  }
}

void PixhawkEmulator::report_parameter(const std::string& name) {
  if (!config_.parameters.has(name)) return;  // PX4 keeps silent, too
  ParamValue message;
  message.param_id = Text<16>(name);
  message.param_count = static_cast<u16>(config_.parameters.size());
  const double value = config_.parameters[name];
  if (PixhawkParameters::is_whole(name)) {
    message.param_type = kParameterInt32;
    const i32 whole = static_cast<i32>(std::lround(value));
    std::memcpy(&message.param_value, &whole, sizeof(whole));
  } else {
    message.param_type = kParameterReal32;
    message.param_value = static_cast<f32>(value);
  }
  send(message);
}

// EKF2 takes what goes to vehicle_visual_odometry; motion capture under its own name reaches nobody.
void PixhawkEmulator::on_odometry(const mavlink::Odometry& message, double now_s) {
  constexpr u8 kVisionInertial = 3, kFrameLocalFrd = 20;
  const bool frames = (message.frame_id == kFrameLocalNed || message.frame_id == kFrameLocalFrd) &&
                      message.child_frame_id == kFrameBodyFrd;
  if (message.estimator_type > kVisionInertial || !frames) {
    ++ignored_;
    return;
  }
  const double sender_s = static_cast<double>(message.time_usec) * 1e-6;
  const double stamp = clock_offset_ ? sender_s - *clock_offset_ : clock(now_s);
  estimator_.take_vision(stamp, clock(now_s), swap_world({message.x, message.y, message.z}),
                         swap_attitude({message.q[0], message.q[1], message.q[2], message.q[3]}),
                         swap_body({message.vx, message.vy, message.vz}));
}

void PixhawkEmulator::offboard_alive(double now_s) {
  if (now_s - offboard_s_ > kStreamGap_s) offboard_since_ = now_s;
  offboard_s_ = now_s;
}

void PixhawkEmulator::on_attitude_target(const SetAttitudeTarget& message, double now_s) {
  const bool stock = config_.firmware == Firmware::kStock;
  const bool has_thrust = (message.type_mask & kThrustBodySet) != 0;
  const Eigen::Vector3d thrust = has_thrust ? swap_body({message.thrust_body[0], message.thrust_body[1], 0.0})
                                            : Eigen::Vector3d::Zero();  // stock: no case for a scalar thrust
  offboard_alive(now_s);
  if ((message.type_mask & kIgnoreAttitude) == 0) {
    offboard_ = Setpoint();
    offboard_.level = Level::kAttitude;
    offboard_.q_WB = swap_attitude({message.q[0], message.q[1], message.q[2], message.q[3]});
    offboard_.force_B = thrust;
    return;
  }
  constexpr u8 kIgnoreRollOrPitchRate = 3;
  if ((message.type_mask & kIgnoreRollOrPitchRate) != 0) {
    ++ignored_;
    return;
  }
  const double yaw_rate =
      (message.type_mask & kIgnoreYawRate) != 0 ? kNaN : static_cast<double>(message.body_yaw_rate);
  offboard_ = Setpoint();
  offboard_.level = Level::kRate;
  offboard_.w_WB_B = swap_body({message.body_roll_rate, message.body_pitch_rate, yaw_rate});
  if (stock && thrust.norm() > 0.0) ++ignored_;
  offboard_.force_B = stock ? Eigen::Vector3d::Zero() : thrust;
}

void PixhawkEmulator::on_position_target(const SetPositionTargetLocalNed& message, double now_s) {
  constexpr u16 kForce = 512;
  if (message.coordinate_frame != kFrameLocalNed || (message.type_mask & kForce) != 0) {
    ++ignored_;
    return;
  }
  offboard_alive(now_s);
  const bool stock = config_.firmware == Firmware::kStock;
  Eigen::Vector3d p(message.x, message.y, message.z), v(message.vx, message.vy, message.vz);
  for (int i = 0; i < 3; ++i) {
    // Stock: a position that is ignored becomes the origin.
    if ((message.type_mask & (kIgnorePosition << i)) != 0) p[i] = stock ? 0.0 : kNaN;
    if ((message.type_mask & (kIgnoreVelocity << i)) != 0) v[i] = kNaN;
  }
  offboard_ = Setpoint();
  offboard_.level = Level::kPosition;
  offboard_.p_WB = swap_world(p);
  offboard_.v_WB = swap_world(v);
  if (stock) {
    offboard_.yaw_rate = kNaN;  // the yaw never arrives: neither control nor damping
    return;
  }
  if ((message.type_mask & kIgnoreYaw) == 0) offboard_.yaw = swap_yaw(message.yaw);
  offboard_.yaw_rate =
      (message.type_mask & kIgnoreYawSpeed) != 0 ? 0.0 : -static_cast<double>(message.yaw_rate);
}

void PixhawkEmulator::on_actuator_controls(const SetActuatorControlTarget& message, double now_s) {
  if (config_.firmware == Firmware::kStock) {
    ++ignored_;  // no handler since v1.14
    return;
  }
  offboard_alive(now_s);
  offboard_ = Setpoint();
  const auto& c = message.controls;
  if (message.group_mlx == kGroupWrench) {
    offboard_.level = Level::kWrench;
    offboard_.torque_B = swap_body({c[0], c[1], c[2]});
    offboard_.force_B = swap_body({c[3], c[4], c[5]});
  } else {
    offboard_.duty.assign(vehicle_.thrusters.size(), 0.0);
    for (std::size_t i = 0; i < std::min(c.size(), offboard_.duty.size()); ++i)
      offboard_.duty[i] = std::isfinite(c[i]) ? std::clamp(static_cast<double>(c[i]), 0.0, 1.0) : 0.0;
  }
}

u8 PixhawkEmulator::run_command(const CommandLong& message, double now_s) {
  switch (message.command) {
    case kCommandSetMode:
      return set_mode(mode_of(static_cast<u8>(message.param2)), now_s);
    case kCommandArm:
      return arm(message.param1 > 0.5f, message.param2 == kForceMagic, now_s);
    case kCommandMessageInterval: {
      const u32 id = static_cast<u32>(message.param1);
      if (find_message(id) == nullptr) return kResultDenied;
      if (message.param2 > 0.0f) interval_s_[id] = static_cast<double>(message.param2) * 1e-6;
      return kResultAccepted;
    }
    case kCommandActuatorTest: {
      const int motor = static_cast<int>(message.param5) - 1;
      if (armed_ || motor < 0 || motor >= static_cast<int>(vehicle_.thrusters.size())) return kResultDenied;
      test_duty_.assign(vehicle_.thrusters.size(), 0.0);
      test_duty_[static_cast<std::size_t>(motor)] = std::clamp(static_cast<double>(message.param1), 0.0, 1.0);
      test_until_s_ = now_s + std::min(static_cast<double>(message.param2), kTestLimit_s);
      return kResultAccepted;
    }
    default:
      return kResultUnsupported;
  }
}

u8 PixhawkEmulator::set_mode(FlightMode mode, double now_s) {
  switch (mode) {
    case FlightMode::kManual:
    case FlightMode::kAcro:
    case FlightMode::kStabilized:
      break;
    case FlightMode::kPosition:
      if (!estimator_.valid(clock(now_s))) return kResultTemporarilyRejected;
      break;
    case FlightMode::kOffboard:
      if (now_s - offboard_s_ > kStreamGap_s || now_s - offboard_since_ < kStreamFirst_s - 1e-6) {
        say(kWarning, "Offboard: no stream of set-points");
        return kResultTemporarilyRejected;
      }
      break;
    default:
      return kResultDenied;
  }
  if (mode_ != mode) {
    mode_ = mode;
    holding_ = false;
    const CascadeState state = estimator_.state(clock(now_s));
    hold_yaw_ = yaw_of(state.q_WB);
    cascade_.reset();
  }
  return kResultAccepted;
}

u8 PixhawkEmulator::arm(bool arm, bool force, double now_s) {
  if (arm == armed_) return kResultAccepted;
  const bool stick_mode =
      mode_ == FlightMode::kManual || mode_ == FlightMode::kAcro || mode_ == FlightMode::kStabilized;
  if (!force) {
    if (arm && !stick_mode && !estimator_.valid(clock(now_s))) {
      say(kCritical, "Arming denied: no valid position");
      return kResultTemporarilyRejected;
    }
    if (arm && charge_ < config_.parameters["BAT_CRIT_THR"]) {
      say(kCritical, "Arming denied: battery empty");
      return kResultTemporarilyRejected;
    }
    if (!arm && !stick_mode) return kResultDenied;  // in flight
  }
  armed_ = arm;
  cascade_.reset();
  test_until_s_ = kNever;
  say(kInfo, arm ? "Armed by external command" : "Disarmed by external command");
  return kResultAccepted;
}

void PixhawkEmulator::check_failsafes(double now_s) {
  if (!armed_) return;
  if (mode_ == FlightMode::kOffboard && now_s - offboard_s_ > config_.parameters["COM_OF_LOSS_T"]) {
    const int action = static_cast<int>(std::lround(config_.parameters["COM_OBL_RC_ACT"]));
    say(kCritical, "Failsafe: offboard set-points lost");
    if (action == kActionPosition && set_mode(FlightMode::kPosition, now_s) == kResultAccepted) return;
    set_mode(FlightMode::kManual, now_s);
    if (action != kActionManual) armed_ = false;
  } else if (mode_ == FlightMode::kPosition && !estimator_.valid(clock(now_s))) {
    say(kCritical, "Failsafe: position lost");
    set_mode(FlightMode::kManual, now_s);
  }
  if (charge_ < config_.parameters["BAT_CRIT_THR"] && !battery_told_) {
    battery_told_ = true;
    say(kCritical, "Battery critical");
    if (config_.parameters["COM_LOW_BAT_ACT"] > 0.0) armed_ = false;
  }
}

// What the sticks ask for; without sticks they are centred. Forces are normalised.
Setpoint PixhawkEmulator::manual_setpoint(double now_s) {
  const bool fresh = now_s - sticks_s_ < config_.parameters["COM_RC_LOSS_T"];
  // Forward, to the left, turn to the left; sticks are forward, right, clockwise.
  const double x = fresh ? stick(sticks_.x) : 0.0, y = fresh ? -stick(sticks_.y) : 0.0,
               r = fresh ? -stick(sticks_.r) : 0.0;
  const double dt = std::clamp(now_s - control_s_, 0.0, 0.1);
  Setpoint setpoint;
  const double force = config_.parameters["SC_MAN_F_MAX"];
  setpoint.force_B = {force * x, force * y, 0.0};
  switch (mode_) {
    case FlightMode::kAcro:
      setpoint.level = Level::kRate;
      setpoint.w_WB_B = {0.0, 0.0, kAcroGain * r};
      return setpoint;
    case FlightMode::kStabilized:
      hold_yaw_ += r * config_.parameters["SPC_MAN_Y_MAX"] * M_PI / 180.0 * dt;
      setpoint.level = Level::kAttitude;
      setpoint.q_WB = Eigen::AngleAxisd(hold_yaw_, Eigen::Vector3d::UnitZ());
      return setpoint;
    case FlightMode::kPosition: {
      const CascadeState state = estimator_.state(clock(now_s));
      const double speed = config_.parameters["SPC_VEL_MANUAL"];
      hold_yaw_ += r * config_.parameters["SPC_MAN_Y_MAX"] * M_PI / 180.0 * dt;
      setpoint.level = Level::kPosition;
      setpoint.yaw = hold_yaw_;
      setpoint.v_WB = state.q_WB * Eigen::Vector3d(speed * x, speed * y, 0.0);
      setpoint.v_WB.z() = kNaN;
      // Sticks centred: brake first, then hold the place.
      const bool centred = x == 0.0 && y == 0.0;
      if (!centred) holding_ = false;
      if (centred && !holding_ && state.v_WB.head<2>().norm() < kHoldSpeed)
        holding_ = true, hold_.p_WB = state.p_WB;
      if (holding_) setpoint.p_WB << hold_.p_WB.head<2>(), kNaN;
      return setpoint;
    }
    default:
      setpoint.level = Level::kWrench;
      setpoint.torque_B = {0.0, 0.0, config_.parameters["SC_MAN_T_MAX"] * r};
      return setpoint;
  }
}

void PixhawkEmulator::control(double now_s) {
  estimator_.predict(clock(now_s), gyro_B_);
  check_failsafes(now_s);
  if (armed_) {
    const Setpoint setpoint = mode_ == FlightMode::kOffboard ? offboard_ : manual_setpoint(now_s);
    duty_ = cascade_.update(now_s, setpoint, estimator_.state(clock(now_s))).allocation.duty;
    duty_.resize(vehicle_.thrusters.size(), 0.0);
  } else if (now_s < test_until_s_) {
    duty_ = test_duty_;
  } else {
    std::fill(duty_.begin(), duty_.end(), 0.0);
  }
  control_s_ = now_s;
}

std::optional<ThrusterCommand> PixhawkEmulator::tick(double now_s) {
  control(now_s);
  stream(now_s);
  if (xrce_) publish_all(now_s);
  const double period = vehicle_.pwm.period_s;
  if (now_s > next_edge_s_ + period) {  // a pause of the clock: periods that passed meanwhile had no order
    next_edge_s_ += std::floor((now_s - next_edge_s_) / period) * period;
  }
  if (now_s < next_edge_s_ - config_.latch_lead_s - 1e-9) return std::nullopt;
  ThrusterCommand order{next_edge_s_, period, duty_};
  for (double& duty : order.duty) duty = std::round(duty * kTicksPerPeriod) / kTicksPerPeriod;
  next_edge_s_ += period;

  ServoOutputRaw outputs;
  outputs.time_usec = static_cast<u32>(static_cast<u64>(std::llround(clock(order.stamp_s) * 1e6)));
  u16* const raw[] = {&outputs.servo1_raw,  &outputs.servo2_raw,  &outputs.servo3_raw,  &outputs.servo4_raw,
                      &outputs.servo5_raw,  &outputs.servo6_raw,  &outputs.servo7_raw,  &outputs.servo8_raw,
                      &outputs.servo9_raw,  &outputs.servo10_raw, &outputs.servo11_raw, &outputs.servo12_raw,
                      &outputs.servo13_raw, &outputs.servo14_raw, &outputs.servo15_raw, &outputs.servo16_raw};
  for (std::size_t i = 0; i < std::min(std::size(raw), order.duty.size()); ++i)
    *raw[i] = static_cast<u16>(std::lround(order.duty[i] * kTicksPerPeriod));
  send(outputs);
  return order;
}

void PixhawkEmulator::stream(double now_s) {
  for (const auto& [id, interval] : interval_s_) {
    auto [last, first] = streamed_s_.try_emplace(id, now_s);
    if (!first && now_s < last->second + interval - 1e-6) continue;
    // On the beat, unless it was missed by more than one.
    last->second = first || now_s > last->second + 2.0 * interval ? now_s : last->second + interval;
    send_stream(id, now_s);
  }
}

void PixhawkEmulator::send_stream(u32 id, double now_s) {
  const double clock_s = clock(now_s);
  const u64 us = static_cast<u64>(std::llround(clock_s * 1e6));
  const u32 ms = static_cast<u32>(us / 1000);
  const CascadeState state = estimator_.state(clock_s);
  switch (id) {
    case Heartbeat::kId: {
      Heartbeat m;
      m.type = kTypeSpacecraft;
      m.autopilot = kAutopilotPx4;
      m.base_mode = static_cast<u8>(kFlagCustomMode | (armed_ ? kFlagArmed : 0));
      m.custom_mode = static_cast<u32>(main_mode(mode_)) << 16;
      m.system_status = armed_ ? kStateActive : kStateStandby;
      m.mavlink_version = 3;
      return send(m);
    }
    case Timesync::kId: {
      Timesync m;
      m.ts1 = std::llround(clock_s * 1e9);
      return send(m);
    }
    case HighresImu::kId: {
      const Eigen::Vector3d a = swap_body(acceleration_B_), w = swap_body(gyro_B_);
      HighresImu m;
      m.time_usec = us;
      m.xacc = static_cast<f32>(a.x()), m.yacc = static_cast<f32>(a.y()), m.zacc = static_cast<f32>(a.z());
      m.xgyro = static_cast<f32>(w.x()), m.ygyro = static_cast<f32>(w.y()), m.zgyro = static_cast<f32>(w.z());
      m.fields_updated = 63;
      return send(m);
    }
    case AttitudeQuaternion::kId: {
      if (!estimator_.valid(clock_s)) return;
      const Eigen::Quaterniond q = swap_attitude(state.q_WB);
      const Eigen::Vector3d w = swap_body(gyro_B_);
      AttitudeQuaternion m;
      m.time_boot_ms = ms;
      m.q1 = static_cast<f32>(q.w()), m.q2 = static_cast<f32>(q.x());
      m.q3 = static_cast<f32>(q.y()), m.q4 = static_cast<f32>(q.z());
      m.rollspeed = static_cast<f32>(w.x()), m.pitchspeed = static_cast<f32>(w.y()),
      m.yawspeed = static_cast<f32>(w.z());
      return send(m);
    }
    case LocalPositionNed::kId: {
      if (!estimator_.valid(clock_s)) return;
      const Eigen::Vector3d p = swap_world(state.p_WB), v = swap_world(state.v_WB);
      LocalPositionNed m;
      m.time_boot_ms = ms;
      m.x = static_cast<f32>(p.x()), m.y = static_cast<f32>(p.y()), m.z = static_cast<f32>(p.z());
      m.vx = static_cast<f32>(v.x()), m.vy = static_cast<f32>(v.y()), m.vz = static_cast<f32>(v.z());
      return send(m);
    }
    case SysStatus::kId: {
      SysStatus m;
      m.voltage_battery = static_cast<u16>(std::lround(voltage_v_ * 1e3));
      m.current_battery = -1;
      m.battery_remaining = static_cast<i8>(std::lround(charge_ * 100.0));
      return send(m);
    }
    case BatteryStatus::kId: {
      BatteryStatus m;
      m.voltages.fill(0xFFFF);
      m.voltages[0] = static_cast<u16>(std::lround(voltage_v_ * 1e3));
      m.current_battery = -1;
      m.battery_remaining = static_cast<i8>(std::lround(charge_ * 100.0));
      return send(m);
    }
    case ExtendedSysState::kId:
      return send(ExtendedSysState());
    case EstimatorStatus::kId: {
      EstimatorStatus m;
      m.time_usec = us;
      return send(m);
    }
    default:
      return;
  }
}

}  // namespace atmos
