// What the link puts on the wire for PX4, and what it makes of PX4's messages.
#include "atmos_px4_bridge/mavlink/mavlink_link.h"

#include <gtest/gtest.h>

#include <cmath>

#include "atmos_px4_bridge/frames.h"
#include "atmos_px4_bridge/mavlink/px4.h"

namespace atmos {
namespace {

using namespace mavlink;
using Eigen::Vector3d;

constexpr double kNow = 1234.5, kNaN = std::numeric_limits<double>::quiet_NaN();

Vehicle vehicle() { return load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml"); }

struct Wire {
  explicit Wire(Firmware firmware, TelemetryListener listener = {})
      : link(
            {firmware, {1, kComponentOnboardComputer}, {1, kComponentAutopilot}, 1.5}, vehicle(),
            [this](const u8* data, std::size_t size) { parser.push(data, size), ++frames; },
            std::move(listener)) {}

  // The next message on the wire, which must be of this type.
  template <class Message>
  Message next() {
    const auto frame = parser.next();
    if (!frame || frame->info->id != Message::kId) {
      ADD_FAILURE() << "expected " << Message::kName << ", got " << (frame ? frame->info->name : "nothing");
      return Message();
    }
    return *decode<Message>(*frame);
  }

  template <class Message>
  void receive(const Message& message, Address from = {1, 1}, double now_s = kNow) {
    u8 frame[kMaxFrame];
    link.receive(frame, encode(message, from, sequence++, frame), now_s);
  }

  Parser parser;
  int frames = 0;
  u8 sequence = 0;
  MavlinkLink link;
};

Setpoint setpoint_of(Level level) {
  Setpoint s;
  s.level = level;
  s.force_B = {1.7, -0.34, 0.0};
  s.torque_B = {0.0, 0.0, 0.408};
  s.w_WB_B = {kNaN, kNaN, 0.3};
  s.q_WB = Eigen::AngleAxisd(0.4, Vector3d::UnitZ());
  s.duty = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8};
  return s;
}

TEST(SetpointOnTheWire, AttitudeCarriesAThreeDimensionalThrust) {
  for (const Firmware firmware : {Firmware::kStock, Firmware::kPatched}) {
    Wire wire(firmware);
    wire.link.send_setpoint(setpoint_of(Level::kAttitude), {}, kNow);
    const auto m = wire.next<SetAttitudeTarget>();
    EXPECT_EQ(m.type_mask, 39);
    EXPECT_EQ(m.target_system, 1);
    EXPECT_EQ(m.target_component, 1);
    EXPECT_NEAR(m.thrust_body[0], 0.5, 1e-6);  // of 3.4 N
    EXPECT_NEAR(m.thrust_body[1], 0.1, 1e-6);  // to the right
    EXPECT_NEAR(std::atan2(2.0 * m.q[0] * m.q[3], 1.0 - 2.0 * m.q[3] * m.q[3]), M_PI_2 - 0.4, 1e-6);
  }
}

TEST(SetpointOnTheWire, RateIsARateOnlyWhereItsThrustArrives) {
  Wire patched(Firmware::kPatched);
  patched.link.send_setpoint(setpoint_of(Level::kRate), {}, kNow);
  const auto m = patched.next<SetAttitudeTarget>();
  EXPECT_EQ(m.type_mask, 128 + 32);
  EXPECT_NEAR(m.body_yaw_rate, -0.3, 1e-6);
  EXPECT_EQ(m.body_roll_rate, 0.0f);
  EXPECT_NEAR(m.thrust_body[0], 0.5, 1e-6);

  Wire stock(Firmware::kStock);
  OdometrySample measured;
  measured.q_WB = Eigen::AngleAxisd(0.7, Vector3d::UnitZ());
  stock.link.send_setpoint(setpoint_of(Level::kRate), measured, kNow);
  const auto a = stock.next<SetAttitudeTarget>();
  EXPECT_EQ(a.type_mask, 39);
  const double yaw = M_PI_2 - std::atan2(2.0 * a.q[0] * a.q[3], 1.0 - 2.0 * a.q[3] * a.q[3]);
  EXPECT_NEAR(1.5 * 2.0 * std::sin(0.5 * (yaw - 0.7)), 0.3, 1e-6);  // what PX4's attitude loop makes of it
}

TEST(SetpointOnTheWire, WrenchAndThrustersNeedAPatch) {
  Wire wire(Firmware::kPatched);
  wire.link.send_setpoint(setpoint_of(Level::kWrench), {}, kNow);
  const auto wrench = wire.next<SetActuatorControlTarget>();
  EXPECT_EQ(wrench.group_mlx, kGroupWrench);
  EXPECT_NEAR(wrench.controls[2], -0.5, 1e-6);  // of 0.816 N m, clockwise positive
  EXPECT_NEAR(wrench.controls[3], 0.5, 1e-6);
  EXPECT_NEAR(wrench.controls[4], 0.1, 1e-6);
  wire.link.send_setpoint(setpoint_of(Level::kThrusters), {}, kNow);
  const auto direct = wire.next<SetActuatorControlTarget>();
  EXPECT_EQ(direct.group_mlx, kGroupThrusters);
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(direct.controls[i], 0.1 * (i + 1), 1e-6);
  wire.link.send_closed(kNow);
  EXPECT_EQ(wire.next<SetActuatorControlTarget>().controls, Floats<8>{});
}

TEST(SetpointOnTheWire, PositionMasksWhatIsNotControlled) {
  Wire wire(Firmware::kPatched);
  Setpoint s;
  s.level = Level::kPosition;
  s.p_WB = {1.0, 2.0, kNaN};
  s.v_WB = {kNaN, 0.2, kNaN};
  s.yaw = 0.3;
  wire.link.send_setpoint(s, {}, kNow);
  const auto m = wire.next<SetPositionTargetLocalNed>();
  EXPECT_EQ(m.coordinate_frame, kFrameLocalNed);
  EXPECT_FLOAT_EQ(m.x, 2.0f);
  EXPECT_FLOAT_EQ(m.y, 1.0f);
  EXPECT_FLOAT_EQ(m.vx, 0.2f);
  EXPECT_NEAR(m.yaw, M_PI_2 - 0.3, 1e-6);
  EXPECT_EQ(m.type_mask, 4 + 16 + 32 + 64 + 128 + 256);  // z; vy, vz; accelerations
  EXPECT_EQ(m.type_mask & 512, 0) << "a force flag is refused by PX4";
}

// Nothing is silently not sent: whoever asks is told, by level and firmware.
TEST(Support, SaysWhatStockFirmwareDoesNotTake) {
  using How = LevelSupport::How;
  Wire stock(Firmware::kStock), patched(Firmware::kPatched);
  for (const Level level :
       {Level::kPosition, Level::kAttitude, Level::kRate, Level::kWrench, Level::kThrusters}) {
    EXPECT_EQ(patched.link.support(level).how, How::kNatural);
    EXPECT_FALSE(stock.link.support(level).statement.empty());
  }
  EXPECT_EQ(stock.link.support(Level::kAttitude).how, How::kNatural);
  EXPECT_EQ(stock.link.support(Level::kRate).how, How::kWorkAround);
  EXPECT_EQ(stock.link.support(Level::kWrench).how, How::kNone);
  EXPECT_EQ(stock.link.support(Level::kThrusters).how, How::kNone);
  EXPECT_TRUE(patched.link.can_close());
  EXPECT_FALSE(stock.link.can_close());
}

TEST(OdometryOnTheWire, IsVisionInNedAndFrd) {
  Wire wire(Firmware::kStock);
  OdometrySample o;
  o.stamp_s = kNow - 0.01;
  o.p_WB = {1, 2, 0};
  o.q_WB = Eigen::AngleAxisd(0.4, Vector3d::UnitZ());
  o.v_WB_B = {0.1, 0.2, 0.0};
  o.w_WB_B = {0.0, 0.0, 0.5};
  o.pose_covariance.diagonal() << 1, 2, 3, 4, 5, 6;
  o.twist_covariance.diagonal() << 1, 2, 3, 4, 5, 6;
  wire.link.send_odometry(o, kNow);
  const auto m = wire.next<mavlink::Odometry>();
  EXPECT_EQ(m.estimator_type, 2);
  EXPECT_EQ(m.frame_id, 1);
  EXPECT_EQ(m.child_frame_id, 12);
  EXPECT_EQ(m.time_usec, 1234490000u);
  EXPECT_FLOAT_EQ(m.x, 2.0f);
  EXPECT_FLOAT_EQ(m.vy, -0.2f);
  EXPECT_FLOAT_EQ(m.yawspeed, -0.5f);
  EXPECT_FLOAT_EQ(m.pose_covariance[0], 2.0f);
  EXPECT_FLOAT_EQ(m.pose_covariance[6], 1.0f);   // second on the diagonal
  EXPECT_FLOAT_EQ(m.pose_covariance[20], 6.0f);  // last
  EXPECT_FLOAT_EQ(m.velocity_covariance[6], 2.0f);
}

TEST(Commands, ModeArmAndRefusal) {
  std::string refusal;
  TelemetryListener listener;
  listener.refusal = [&](const std::string& text) { refusal = text; };
  Wire wire(Firmware::kStock, listener);
  wire.link.send_mode(FlightMode::kOffboard, kNow);
  const auto mode = wire.next<CommandLong>();
  EXPECT_EQ(mode.command, 176);
  EXPECT_EQ(mode.param1, 1.0f);
  EXPECT_EQ(mode.param2, 6.0f);
  wire.link.send_arm(false, true, kNow);
  const auto disarm = wire.next<CommandLong>();
  EXPECT_EQ(disarm.command, 400);
  EXPECT_EQ(disarm.param1, 0.0f);
  EXPECT_EQ(disarm.param2, 21196.0f);
  CommandAck ack;
  ack.command = 176;
  ack.result = kResultTemporarilyRejected;
  wire.receive(ack);
  EXPECT_EQ(refusal, "mode offboard: temporarily rejected");
}

TEST(Telemetry, ComesInOurFramesAndOnlyFromTheAutopilot) {
  AutopilotState state;
  MotionEstimate motion;
  ImuReading imu{};
  BatteryReading battery{};
  ActuatorReading actuators{};
  TelemetryListener listener;
  listener.state = [&](const AutopilotState& s) { state = s; };
  listener.motion = [&](const MotionEstimate& m) { motion = m; };
  listener.imu = [&](const ImuReading& i) { imu = i; };
  listener.battery = [&](const BatteryReading& b) { battery = b; };
  listener.actuators = [&](const ActuatorReading& a) { actuators = a; };
  Wire wire(Firmware::kStock, listener);

  Heartbeat heartbeat;
  heartbeat.base_mode = 0x80;
  heartbeat.custom_mode = 6u << 16;
  wire.receive(heartbeat, {255, 190});
  EXPECT_FALSE(state.armed);
  EXPECT_EQ(wire.link.counters().foreign, 1u);
  wire.receive(heartbeat);
  EXPECT_TRUE(state.armed);
  EXPECT_EQ(state.mode, FlightMode::kOffboard);

  LocalPositionNed position;
  position.x = 1, position.y = 2, position.z = 3, position.vx = 0.1f;
  wire.receive(position);
  EXPECT_NEAR((motion.p_WB - Vector3d(2, 1, -3)).norm(), 0.0, 1e-6);
  EXPECT_NEAR(motion.v_WB.y(), 0.1, 1e-6);

  HighresImu sensors;
  sensors.zgyro = 0.5f, sensors.zacc = -9.81f;
  wire.receive(sensors);
  EXPECT_NEAR(imu.w_B.z(), -0.5, 1e-6);
  EXPECT_NEAR(imu.acceleration_B.z(), 9.81, 1e-5);

  BatteryStatus power;
  power.voltages.fill(0xFFFF);
  power.voltages[0] = 24000;
  power.battery_remaining = 55;
  power.current_battery = -1;
  wire.receive(power);
  EXPECT_NEAR(battery.voltage_v, 24.0, 1e-9);
  EXPECT_NEAR(battery.share, 0.55, 1e-9);
  EXPECT_TRUE(std::isnan(battery.current_a));

  ServoOutputRaw outputs;
  outputs.servo1_raw = 10000, outputs.servo8_raw = 1;
  wire.receive(outputs);
  ASSERT_EQ(actuators.duty.size(), 8u);
  EXPECT_EQ(actuators.duty[0], 1.0);
  EXPECT_NEAR(actuators.duty[7], 1e-4, 1e-12);
}

TEST(Parameters, WholeNumbersAreTheBitsOfTheFloat) {
  std::optional<Parameter> got;
  TelemetryListener listener;
  listener.parameter = [&](const Parameter& p) { got = p; };
  Wire wire(Firmware::kStock, listener);
  wire.link.set_parameter({"COM_OBL_RC_ACT", 7.0, kParameterInt32});
  const auto set = wire.next<ParamSet>();
  EXPECT_EQ(set.param_id.str(), "COM_OBL_RC_ACT");
  ParamValue value;
  value.param_id = set.param_id;
  value.param_value = set.param_value;
  value.param_type = kParameterInt32;
  wire.receive(value);
  ASSERT_TRUE(got);
  EXPECT_EQ(got->value, 7.0);
  wire.link.request_parameter("SC_YAW_P");
  EXPECT_EQ(wire.next<ParamRequestRead>().param_index, -1);
}

TEST(Timesync, RequestsAreAnsweredAndOldRepliesIgnored) {
  Wire wire(Firmware::kStock);
  Timesync request;
  request.ts1 = 5000000000;
  wire.receive(request);
  const auto reply = wire.next<Timesync>();
  EXPECT_EQ(reply.ts1, request.ts1);
  EXPECT_EQ(reply.tc1, 1234500000000);
  Timesync answer;
  answer.ts1 = 1234498000000;  // we asked 2 ms ago
  answer.tc1 = 6000000000;
  wire.receive(answer);
  ASSERT_TRUE(wire.link.time_sync().known());
  EXPECT_NEAR(*wire.link.time_sync().to_local(6.0), 1234.499, 1e-6);
  answer.ts1 = 1;  // another life of ours
  answer.tc1 = 6100000000;
  wire.receive(answer);
  EXPECT_NEAR(*wire.link.time_sync().to_local(6.0), 1234.499, 1e-6);
}

TEST(Housekeeping, HeartbeatTimesyncAndStreams) {
  Wire wire(Firmware::kStock);
  for (double t = kNow; t < kNow + 9.999; t += 0.02) wire.link.tick(t);
  int heartbeats = 0, timesyncs = 0, commands = 0;
  while (const auto frame = wire.parser.next()) {
    if (const auto m = decode<Heartbeat>(*frame)) {
      ++heartbeats;
      EXPECT_EQ(m->type, 18);
      EXPECT_EQ(m->autopilot, 8);
    }
    timesyncs += frame->info->id == Timesync::kId;
    commands += frame->info->id == CommandLong::kId;
  }
  EXPECT_EQ(heartbeats, 10);
  EXPECT_NEAR(timesyncs, 100, 1);
  EXPECT_EQ(commands, 2 * 6);
}

}  // namespace
}  // namespace atmos
