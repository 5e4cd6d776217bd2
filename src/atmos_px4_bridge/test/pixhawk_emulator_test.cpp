// The emulated autopilot by itself: what PX4 takes and refuses, and what its modes do.
#include "atmos_px4_bridge/emulator/pixhawk_emulator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "atmos_model/strict_yaml.h"
#include "atmos_px4_bridge/mavlink/px4.h"

namespace atmos {
namespace {

using namespace mavlink;

constexpr double kStart = 1234.5;

struct Bench {
  explicit Bench(Firmware firmware = Firmware::kStock)
      : pixhawk(
            config(firmware), load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml"),
            [this](const u8* data, std::size_t size) { parser.push(data, size); }, kStart) {}

  static PixhawkConfig config(Firmware firmware) {
    PixhawkConfig c;
    c.firmware = firmware;
    c.parameters = PixhawkParameters::load(ATMOS_CONFIG_DIR "/px4/pixhawk.yaml");
    return c;
  }
  template <class Message>
  void send(const Message& message) {
    u8 frame[kMaxFrame];
    pixhawk.receive(frame, encode(message, {255, 190}, sequence++, frame), now);
  }
  u8 command(u16 id, float p1, float p2 = 0.0f, float p5 = 0.0f) {
    CommandLong m;
    m.command = id;
    m.param1 = p1, m.param2 = p2, m.param5 = p5;
    m.target_system = m.target_component = 1;
    while (parser.next()) {
    }
    send(m);
    while (const auto frame = parser.next()) {
      if (const auto ack = decode<CommandAck>(*frame)) return ack->result;
    }
    return 255;
  }
  void vision(u8 estimator = kEstimatorVision) {
    mavlink::Odometry m;
    m.time_usec = static_cast<u64>(now * 1e6);
    m.frame_id = kFrameLocalNed, m.child_frame_id = kFrameBodyFrd, m.estimator_type = estimator;
    m.q = {1.0f, 0.0f, 0.0f, 0.0f};  // facing north
    send(m);
  }
  // Lets time pass, calling `each` every 20 ms; the largest duty of each thruster that was latched.
  template <class Each>
  std::vector<double> pass(double duration_s, Each each) {
    std::vector<double> most(8, 0.0);
    const int steps = static_cast<int>(std::lround(duration_s / 0.004));
    for (int k = 0; k < steps; ++k) {
      now += 0.004;
      if (k % 5 == 0) each();
      if (const auto order = pixhawk.tick(now)) {
        for (int i = 0; i < 8; ++i) most[i] = std::max(most[i], order->duty[i]);
      }
      while (parser.next()) {
      }
    }
    return most;
  }
  std::vector<double> pass(double duration_s) {
    return pass(duration_s, [] {});
  }
  template <class Message>
  std::vector<double> fly(const Message& setpoint) {
    const auto stream = [&] { vision(), send(setpoint); };
    pass(1.2, stream);
    EXPECT_EQ(command(kCommandSetMode, 1.0f, 6.0f), kResultAccepted);
    EXPECT_EQ(command(kCommandArm, 1.0f), kResultAccepted);
    return pass(0.5, stream);
  }

  double now = kStart;
  Parser parser;
  u8 sequence = 0;
  PixhawkEmulator pixhawk;
};

double most(const std::vector<double>& duty) { return *std::max_element(duty.begin(), duty.end()); }

SetAttitudeTarget attitude(u8 mask) {
  SetAttitudeTarget m;
  m.q = {1.0f, 0.0f, 0.0f, 0.0f};
  m.type_mask = mask;
  m.thrust = 0.5f;
  m.thrust_body = {0.5f, 0.0f, 0.0f};
  return m;
}

TEST(Setpoints, ThrustNeedsTheBodyThrustBit) {
  EXPECT_NEAR(Bench().fly(attitude(kThrustBodySet | kIgnoreBodyRates))[0], 0.5, 0.01);
  EXPECT_EQ(most(Bench().fly(attitude(kIgnoreBodyRates))), 0.0) << "a scalar thrust has no spacecraft case";
}

TEST(Setpoints, StockRatesComeWithoutThrust) {
  EXPECT_EQ(most(Bench().fly(attitude(kThrustBodySet | kIgnoreAttitude))), 0.0);
  EXPECT_NEAR(Bench(Firmware::kPatched).fly(attitude(kThrustBodySet | kIgnoreAttitude))[0], 0.5, 0.01);
}

TEST(Setpoints, ActuatorControlsNeedAPatch) {
  SetActuatorControlTarget m;
  m.controls[3] = 0.25f;
  EXPECT_NEAR(Bench(Firmware::kPatched).fly(m)[3], 0.25, 1e-4);
  Bench stock;
  stock.pass(1.5, [&] { stock.vision(), stock.send(m); });
  EXPECT_EQ(stock.command(kCommandSetMode, 1.0f, 6.0f), kResultTemporarilyRejected);
  EXPECT_GT(stock.pixhawk.ignored(), 50u);
}

TEST(Setpoints, OutputsAreInStepsOfTenMicroseconds) {
  SetActuatorControlTarget m;
  m.controls[0] = 0.123456f;
  EXPECT_NEAR(Bench(Firmware::kPatched).fly(m)[0], 0.1235, 1e-12);
}

TEST(Offboard, NeedsAStreamOfOneSecond) {
  Bench bench;
  const auto m = attitude(39);
  EXPECT_EQ(bench.command(kCommandSetMode, 1.0f, 6.0f), kResultTemporarilyRejected);
  bench.pass(0.8, [&] { bench.vision(), bench.send(m); });
  EXPECT_EQ(bench.command(kCommandSetMode, 1.0f, 6.0f), kResultTemporarilyRejected);
  bench.pass(0.4, [&] { bench.vision(), bench.send(m); });
  EXPECT_EQ(bench.command(kCommandSetMode, 1.0f, 6.0f), kResultAccepted);
}

TEST(Offboard, LossOfTheStreamDisarms) {
  Bench bench;
  bench.fly(attitude(39));
  EXPECT_TRUE(bench.pixhawk.armed());
  bench.pass(0.45, [&] { bench.vision(); });
  EXPECT_TRUE(bench.pixhawk.armed());
  bench.pass(0.2, [&] { bench.vision(); });
  EXPECT_FALSE(bench.pixhawk.armed());
  EXPECT_EQ(most(bench.pass(0.5)), 0.0);
}

TEST(Vision, MotionCaptureUnderItsOwnNameReachesNobody) {
  constexpr u8 kMocap = 6;
  Bench bench;
  const auto m = attitude(39);
  bench.pass(1.2, [&] { bench.vision(kMocap), bench.send(m); });
  EXPECT_EQ(bench.command(kCommandSetMode, 1.0f, 6.0f), kResultAccepted);
  EXPECT_EQ(bench.command(kCommandArm, 1.0f), kResultTemporarilyRejected) << "no position";
  bench.pass(0.2, [&] { bench.vision(), bench.send(m); });
  EXPECT_EQ(bench.command(kCommandArm, 1.0f), kResultAccepted);
}

TEST(Arming, OnlyByForceOutOfFlightAndNotWithAnEmptyBattery) {
  Bench bench;
  bench.fly(attitude(39));
  EXPECT_EQ(bench.command(kCommandArm, 0.0f), kResultDenied);
  EXPECT_EQ(bench.command(kCommandArm, 0.0f, 21196.0f), kResultAccepted);
  EXPECT_FALSE(bench.pixhawk.armed());
  bench.pixhawk.take_battery(18.0, 0.03);
  EXPECT_EQ(bench.command(kCommandSetMode, 1.0f, 1.0f), kResultAccepted);
  EXPECT_EQ(bench.command(kCommandArm, 1.0f), kResultTemporarilyRejected);
}

ManualControl sticks(i16 forward, i16 right, i16 clockwise) {
  ManualControl m;
  m.x = forward, m.y = right, m.r = clockwise;
  return m;
}

TEST(Manual, SticksAreForcesAndTorque) {
  Bench bench;
  EXPECT_EQ(bench.command(kCommandArm, 1.0f), kResultAccepted);
  EXPECT_EQ(most(bench.pass(0.3)), 0.0) << "no sticks, no thrust";
  const auto forward = bench.pass(0.5, [&] { bench.send(sticks(500, 0, 0)); });
  EXPECT_NEAR(forward[0], 0.5, 1e-3);
  EXPECT_NEAR(forward[2], 0.5, 1e-3);
  EXPECT_EQ(forward[1], 0.0);
  bench.pass(1.0);
  const auto right = bench.pass(0.5, [&] { bench.send(sticks(0, 500, 0)); });
  EXPECT_NEAR(right[4], 0.5, 1e-3);  // pushes along -y
  bench.pass(1.0);
  EXPECT_EQ(most(bench.pass(0.5)), 0.0) << "sticks are old";
}

TEST(Manual, AcroAndStabilisedTurnWithTheStick) {
  for (const float mode : {5.0f, 7.0f}) {
    Bench bench;
    bench.pass(0.2, [&] { bench.vision(); });
    EXPECT_EQ(bench.command(kCommandSetMode, 1.0f, mode), kResultAccepted);
    EXPECT_EQ(bench.command(kCommandArm, 1.0f), kResultAccepted);
    const auto duty = bench.pass(0.5, [&] { bench.vision(), bench.send(sticks(0, 0, 200)); });
    EXPECT_GT(duty[0], 0.05) << mode;  // thrusters 1, 4, 6, 7 turn clockwise
    EXPECT_EQ(duty[1], 0.0) << mode;
  }
}

TEST(Parameters, AreReadSetAndUsed) {
  Bench bench;
  ParamSet set;
  set.param_id = Text<16>("SC_MAN_F_MAX");
  set.param_value = 0.5f;
  set.param_type = kParameterReal32;
  bench.send(set);
  const auto frame = bench.parser.next();
  ASSERT_TRUE(frame && decode<ParamValue>(*frame));
  EXPECT_EQ(decode<ParamValue>(*frame)->param_value, 0.5f);
  bench.command(kCommandArm, 1.0f);
  EXPECT_NEAR(bench.pass(0.5, [&] { bench.send(sticks(1000, 0, 0)); })[0], 0.5, 1e-3);
}

TEST(Parameters, AnUnknownNameInTheFileIsAnError) {
  const std::string path = ::testing::TempDir() + "pixhawk_under_test.yaml";
  std::ofstream(path) << "parameters: {SC_YAW_P: x, NO_SUCH: 1}";
  try {
    PixhawkParameters::load(path);
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    for (const char* key : {"SC_YAW_P", "NO_SUCH"})
      EXPECT_NE(std::string(error.what()).find(key), std::string::npos);
  }
}

TEST(ActuatorTest, OpensOneValveOfADisarmedVehicleForAtMostThreeSeconds) {
  Bench bench;
  EXPECT_EQ(bench.command(kCommandActuatorTest, 0.3f, 10.0f, 5.0f), kResultAccepted);
  const auto duty = bench.pass(2.9);
  EXPECT_NEAR(duty[4], 0.3, 1e-4);
  EXPECT_EQ(duty[0], 0.0);
  bench.pass(0.3);
  EXPECT_EQ(most(bench.pass(1.0)), 0.0);
  bench.command(kCommandArm, 1.0f);
  EXPECT_EQ(bench.command(kCommandActuatorTest, 0.3f, 1.0f, 5.0f), kResultDenied);
}

}  // namespace
}  // namespace atmos
