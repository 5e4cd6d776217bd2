// Bridge, serial line, emulated Pixhawk and robot in one loop: every level flies, every safety rule closes
// the valves, every fault of the line ends in flight again.
#include <gtest/gtest.h>

#include <cmath>

#include "flight_bench.h"

namespace atmos::test {
namespace {

struct Case {
  Firmware firmware;  // as MAVLink sees it
  Level level;
  double position_m, yaw_deg;
  LinkChoice link = LinkChoice::kMavlink;
};
constexpr LinkChoice kXrce = LinkChoice::kXrce, kBoth = LinkChoice::kBoth;

class Levels : public ::testing::TestWithParam<Case> {};

TEST_P(Levels, ReachesAPoseAndRests) {
  const Case c = GetParam();
  FlightBench bench(c.firmware, go_to(c.level, {0.4, -0.2}, 0.5), c.link);
  ASSERT_TRUE(bench.take_off()) << bench.bridge.manager().status().refusal;
  bench.fly(40.0);
  double position = 0.0, yaw = 0.0;
  bench.fly(5.0, [&] {
    position = std::max(position, (bench.body.p - Eigen::Vector2d(0.4, -0.2)).norm());
    yaw = std::max(yaw, std::abs(bench.body.yaw - 0.5));
  });
  EXPECT_LT(position, c.position_m);
  EXPECT_LT(yaw, c.yaw_deg * M_PI / 180.0);
  EXPECT_EQ(bench.bridge.manager().status().state, OffboardSession::State::kFlying);
  EXPECT_EQ(bench.pixhawk.stray(), 0u) << "PX4 obeys set-points in every mode";
}

INSTANTIATE_TEST_SUITE_P(All, Levels,
                         ::testing::Values(Case{Firmware::kPatched, Level::kThrusters, 0.01, 1.0},
                                           Case{Firmware::kPatched, Level::kWrench, 0.01, 1.0},
                                           Case{Firmware::kPatched, Level::kRate, 0.01, 1.0},
                                           Case{Firmware::kPatched, Level::kAttitude, 0.01, 1.0},
                                           Case{Firmware::kPatched, Level::kPosition, 0.01, 1.0},
                                           Case{Firmware::kStock, Level::kRate, 0.03, 2.0},
                                           Case{Firmware::kStock, Level::kAttitude, 0.01, 1.0},
                                           Case{Firmware::kStock, Level::kThrusters, 0.01, 1.0, kXrce},
                                           Case{Firmware::kStock, Level::kWrench, 0.01, 1.0, kXrce},
                                           Case{Firmware::kStock, Level::kRate, 0.01, 1.0, kXrce},
                                           Case{Firmware::kStock, Level::kAttitude, 0.01, 1.0, kXrce},
                                           Case{Firmware::kStock, Level::kPosition, 0.01, 1.0, kXrce},
                                           Case{Firmware::kStock, Level::kThrusters, 0.01, 1.0, kBoth},
                                           Case{Firmware::kStock, Level::kWrench, 0.01, 1.0, kBoth},
                                           Case{Firmware::kStock, Level::kRate, 0.01, 1.0, kBoth}));

TEST(StockFirmware, LosesTheYawOfAPositionSetpoint) {
  FlightBench bench(Firmware::kStock, go_to(Level::kPosition, {0.3, 0.0}, 0.5));
  ASSERT_TRUE(bench.take_off());
  bench.fly(40.0);
  EXPECT_NEAR(bench.body.p.x(), 0.3, 0.01);
  EXPECT_NEAR(bench.body.yaw, 0.0, 0.02);
}

TEST(StockFirmware, RefusesLevelsThatHaveNoMessageAndSaysSo) {
  for (const Level level : {Level::kWrench, Level::kThrusters}) {
    FlightBench bench(Firmware::kStock, go_to(level, {0.3, 0.0}, 0.0));
    EXPECT_FALSE(bench.take_off(5.0));
    EXPECT_GT(bench.bridge.manager().status().unsupported, 0u);
    EXPECT_EQ(bench.bridge.manager().status().verdict.rule, Rule::kSetpointOld);
    EXPECT_FALSE(bench.pixhawk.armed());
  }
}

// --- safety: each rule closes the valves, and says which it was ---

constexpr double kPeriod = 0.1;

struct Connection {
  Firmware firmware;
  LinkChoice link = LinkChoice::kMavlink;
};

class Safety : public ::testing::TestWithParam<Connection> {
 protected:
  // A robot that always has to push: it flies against a steady force.
  Safety() : bench(GetParam().firmware, go_to(Level::kRate, {0.2, 0.0}, 0.0), GetParam().link) {
    bench.disturbance = {0.3, 0.1, 0.01};
    EXPECT_TRUE(bench.take_off());
    bench.fly(3.0);
    EXPECT_LT(bench.closed_for_s(), 2.0 * kPeriod);
  }
  // Valves close within the rule's limit and what the PWM period, the line and the ticks add; they stay
  // closed.
  void expect_closed(Rule rule, double limit_s) {
    const double begin = bench.now;
    bool named = false;
    bench.fly(limit_s + 1.5, [&] { named |= bench.bridge.manager().status().verdict.rule == rule; });
    EXPECT_TRUE(named) << name_of(bench.bridge.manager().status().verdict.rule);
    EXPECT_GT(bench.closed_for_s(), bench.now - begin - limit_s - 1.5 * kPeriod) << "closed too late";
  }
  void expect_resumed() {
    EXPECT_TRUE(bench.fly_until([&] { return bench.flying() && bench.open_valves() > 0; }, 5.0))
        << "no recovery";
  }
  FlightBench bench;
};

TEST_P(Safety, OldSetpoint) {
  const Law law = bench.law;
  bench.law = [](double, const BodyState&) { return std::nullopt; };
  expect_closed(Rule::kSetpointOld, 0.5);
  bench.law = law;
  expect_resumed();
}

TEST_P(Safety, LostOdometry) {
  bench.odometry_on = false;
  expect_closed(Rule::kOdometryLost, 0.5);
  bench.odometry_on = true;
  expect_resumed();
}

TEST_P(Safety, FailedNmpc) {
  bench.bridge.manager().take_nmpc(true);
  expect_closed(Rule::kNmpcFailed, 0.02);
  bench.bridge.manager().take_nmpc(false);
  expect_resumed();
}

TEST_P(Safety, ClosedCommandOfTheController) {
  const Law law = bench.law;
  bench.law = [](double, const BodyState&) {
    Setpoint closed;
    closed.duty.assign(8, 0.0);
    return std::optional<Setpoint>(closed);
  };
  const double begin = bench.now;
  bench.fly(2.0);
  EXPECT_GT(bench.closed_for_s(), bench.now - begin - 2.5 * kPeriod);
  bench.law = law;
  expect_resumed();
}

TEST_P(Safety, LostLink) {
  bench.unplug();
  expect_closed(Rule::kLinkLost, 0.5);
  EXPECT_FALSE(bench.bridge.manager().status().connected);
  bench.plug();
  expect_resumed();
}

TEST_P(Safety, Kill) {
  bench.bridge.manager().set_kill(true);
  expect_closed(Rule::kKill, 0.05);
  EXPECT_FALSE(bench.pixhawk.armed());
  bench.bridge.manager().set_kill(false);
  bench.fly(3.0);
  EXPECT_FALSE(bench.pixhawk.armed()) << "a kill that is taken back must not start the flight";
  bench.bridge.manager().request(true);
  expect_resumed();
}

TEST_P(Safety, LowBattery) {
  bench.pixhawk.take_battery(20.0, 0.10);
  expect_closed(Rule::kBatteryLow, 1.0);  // told once a second
  EXPECT_FALSE(bench.pixhawk.armed());
  bench.pixhawk.take_battery(24.0, 0.9);
  bench.fly(3.0);
  EXPECT_FALSE(bench.pixhawk.armed()) << "a voltage that recovers without load is no charge";
}

TEST_P(Safety, LeftEnvelopeIsHeldByTheAutopilot) {
  bench.disturbance.setZero();
  bench.body.p = {4.95, 0.0};
  bench.body.v = {0.2, 0.0};
  bench.law = go_to(Level::kRate, {20.0, 0.0}, 0.0);  // a controller that wants out
  ASSERT_TRUE(bench.fly_until([&] { return bench.pixhawk.mode() == FlightMode::kPosition; }, 5.0));
  EXPECT_EQ(bench.bridge.manager().status().verdict.rule, Rule::kEnvelopeLeft);
  bench.fly(60.0);
  EXPECT_EQ(bench.bridge.manager().status().state, OffboardSession::State::kStabilised);
  EXPECT_LT(bench.body.v.norm(), 0.005);
  EXPECT_LT(bench.body.p.x(), 5.5);
  // At rest nothing is left to push against.
  int open = 0, steps = 0;
  bench.fly(2.0, [&] { open += bench.open_valves(), ++steps; });
  EXPECT_LT(static_cast<double>(open) / steps, 0.02);

  // Back inside, asked again, it flies again.
  bench.body.p = {0.0, 0.0};
  bench.law = go_to(Level::kRate, {0.2, 0.0}, 0.0);
  bench.fly(0.5);
  bench.bridge.manager().request(true);
  expect_resumed();
}

TEST_P(Safety, TooFastIsAnEnvelopeToo) {
  bench.body.yaw_rate = 2.5;
  EXPECT_TRUE(bench.fly_until([&] { return bench.pixhawk.mode() == FlightMode::kPosition; }, 1.0));
  EXPECT_EQ(bench.bridge.manager().status().verdict.rule, Rule::kEnvelopeLeft);
  bench.fly(10.0);
  EXPECT_LT(std::abs(bench.body.yaw_rate), 0.1);
}

TEST_P(Safety, StopDisarmsThroughManual) {
  bench.bridge.manager().request(false);
  EXPECT_TRUE(bench.fly_until([&] { return !bench.pixhawk.armed(); }, 2.0));
  EXPECT_EQ(bench.pixhawk.mode(), FlightMode::kManual);
  bench.fly(2.0);
  EXPECT_EQ(bench.bridge.manager().status().state, OffboardSession::State::kIdle);
}

// A pilot's switch, sent by another ground station, at any time.
TEST_P(Safety, APilotWhoTakesOverIsNotFought) {
  const auto pilot_takes_over = [&] {
    mavlink::CommandLong command;
    command.command = 176;
    command.param1 = 1.0f, command.param2 = 1.0f;  // manual
    mavlink::u8 frame[mavlink::kMaxFrame];
    bench.pixhawk.receive(frame, mavlink::encode(command, {255, 190}, 0, frame), bench.now);
    bench.fly(5.0);
    EXPECT_EQ(bench.pixhawk.mode(), FlightMode::kManual);
    EXPECT_EQ(bench.bridge.manager().status().state, OffboardSession::State::kReleased);
    EXPECT_GT(bench.closed_for_s(), 4.5);
  };
  bench.fly(5.0);
  pilot_takes_over();
  bench.bridge.manager().request(true);
  expect_resumed();

  bench.fly(5.0);
  bench.body.yaw_rate = 2.5;  // the envelope is left
  ASSERT_TRUE(bench.fly_until([&] { return bench.pixhawk.mode() == FlightMode::kPosition; }, 1.0));
  bench.fly(5.0);
  pilot_takes_over();
  bench.bridge.manager().request(true);
  expect_resumed();

  if (!bench.bridge.link().can_close()) return;  // closed means disarmed there
  bench.fly(5.0);
  bench.odometry_on = false;
  bench.fly(2.0);
  pilot_takes_over();
  bench.odometry_on = true;
  bench.fly(3.0);
  EXPECT_EQ(bench.pixhawk.mode(), FlightMode::kManual);
}

// --- faults of the line ---

TEST_P(Safety, OnePercentOfDamagedBytesIsFlownThrough) {
  bench.for_each_line([](Line& line) { line.corruption = 0.01; });
  int not_flying = 0;
  bench.fly(30.0, [&] { not_flying += bench.flying() ? 0 : 1; });
  EXPECT_EQ(not_flying, 0);
  if (bench.bridge.mavlink() != nullptr) {
    EXPECT_GT(bench.bridge.mavlink()->counters().bad_crc, 100u);
  }
  if (bench.bridge.xrce() != nullptr) {
    EXPECT_GT(bench.bridge.xrce()->counters().bad_crc, 100u);
  }
  bench.for_each_line([](Line& line) { line.corruption = 0.0; });
  bench.disturbance.setZero();
  bench.fly(30.0);
  EXPECT_NEAR(bench.body.p.x(), 0.2, 0.03);
}

TEST_P(Safety, StallsOf100MsAreFlownThrough) {
  for (int k = 0; k < 20; ++k) {
    bench.for_each_line([&](Line& line) { line.stalled_until_s = bench.now + 0.1; });
    bench.fly(1.0);
    EXPECT_TRUE(bench.flying()) << k;
  }
}

TEST_P(Safety, ThreeSecondsUnplugged) {
  bench.unplug();
  bench.fly(3.0);
  EXPECT_GT(bench.closed_for_s(), 3.0 - 0.5 - 2.0 * kPeriod);
  bench.plug();
  expect_resumed();
}

TEST_P(Safety, RebootOfTheAutopilot) {
  bench.reboot();
  EXPECT_EQ(bench.open_valves(), 0);
  bench.fly(1.0);
  EXPECT_GT(bench.closed_for_s(), 0.99);
  expect_resumed();
  if (bench.bridge.mavlink() != nullptr) {
    EXPECT_EQ(bench.bridge.mavlink()->counters().reboots, 1u);
  }
  if (bench.bridge.xrce() != nullptr) {
    EXPECT_EQ(bench.bridge.xrce()->counters().reboots, 1u);
  }
}

// With both links, either line that is lost closes the valves, and either line disarms.
TEST_P(Safety, EachLineByItselfIsMissed) {
  if (GetParam().link != kBoth) return;
  for (const bool mavlink : {true, false}) {
    Line& down = mavlink ? bench.down : bench.xrce_down;
    Line& up = mavlink ? bench.up : bench.xrce_up;
    down.unplugged = up.unplugged = true;
    expect_closed(Rule::kLinkLost, 0.5);
    bench.bridge.manager().set_kill(true);
    bench.fly(1.0);
    EXPECT_FALSE(bench.pixhawk.armed());
    down.unplugged = up.unplugged = false;
    bench.bridge.manager().set_kill(false);
    bench.fly(6.0);
    bench.bridge.manager().request(true);
    expect_resumed();
    bench.fly(3.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Firmware, Safety,
                         ::testing::Values(Connection{Firmware::kPatched}, Connection{Firmware::kStock},
                                           Connection{Firmware::kStock, kXrce},
                                           Connection{Firmware::kStock, kBoth}));

// --- the line's load and clocks ---

TEST(Clocks, AfterAStepBackNothingOldCountsAsFresh) {
  Supervisor supervisor(bench_config(Firmware::kStock).safety);
  OdometrySample odometry;
  odometry.stamp_s = 1000.0;
  supervisor.on_link(1000.0), supervisor.on_odometry(odometry, 1000.0), supervisor.on_setpoint(1000.0);
  EXPECT_EQ(supervisor.judge(1000.1).reaction, Reaction::kFly);
  EXPECT_EQ(supervisor.judge(990.0).rule, Rule::kLinkLost);
  supervisor.on_link(990.1);
  EXPECT_EQ(supervisor.judge(990.1).rule, Rule::kOdometryLost);
  odometry.stamp_s = 990.2;
  supervisor.on_odometry(odometry, 990.2);
  EXPECT_EQ(supervisor.judge(990.2).rule, Rule::kSetpointOld);
  supervisor.on_setpoint(990.3);
  EXPECT_EQ(supervisor.judge(990.3).reaction, Reaction::kFly);
}

TEST(Line, TrafficFitsTheLineWithRoomToSpare) {
  FlightBench bench(Firmware::kPatched, go_to(Level::kRate, {0.2, 0.0}, 0.0));
  ASSERT_TRUE(bench.take_off());
  bench.down.bytes = bench.up.bytes = 0;
  bench.fly(10.0);
  std::printf("to the autopilot %.1f %%, from it %.1f %% of 921600 baud\n",
              100.0 * static_cast<double>(bench.down.bytes) / 10.0 / FlightBench::kBytesPerSecond,
              100.0 * static_cast<double>(bench.up.bytes) / 10.0 / FlightBench::kBytesPerSecond);
  EXPECT_LT(static_cast<double>(bench.down.bytes) / 10.0, 0.5 * FlightBench::kBytesPerSecond);
  EXPECT_LT(static_cast<double>(bench.up.bytes) / 10.0, 0.5 * FlightBench::kBytesPerSecond);
}

TEST(Clocks, OffsetAndSkewAreFound) {
  FlightBench bench(Firmware::kPatched, go_to(Level::kRate, {0.2, 0.0}, 0.0));
  bench.fly(120.0);
  EXPECT_EQ(bench.bridge.mavlink()->counters().reboots, 0u);
  const TimeSync& sync = bench.bridge.mavlink()->time_sync();
  ASSERT_TRUE(sync.known());
  const double remote = 1.0 + (bench.now - FlightBench::kStart) * (1.0 + 2e-5);
  EXPECT_NEAR(*sync.to_local(remote), bench.now, 2e-3);  // the bench reads the line every millisecond
  EXPECT_NEAR(sync.skew(), -2e-5, 1e-5);
}

}  // namespace
}  // namespace atmos::test
