#include "atmos_px4_bridge/flight_controller.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

namespace atmos {
namespace {

constexpr double kStart = 1234.5;
constexpr double kPeriod = 0.1;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Vehicle test_vehicle(double min_on_time_s = 0.0) {
  Vehicle vehicle = load_vehicle(std::string(ATMOS_CONFIG_DIR) + "/vehicle/atmos.yaml");
  vehicle.pwm.min_on_time_s = min_on_time_s;
  return vehicle;
}

ThrusterCommand command(double stamp, double duty = 0.4) {
  return {stamp, kPeriod, std::vector<double>(8, duty)};
}

bool all_closed(const ValveOrder& order) {
  return order.command.duty == std::vector<double>(8, 0.0) && !order.status.flying;
}

// Half of a rate error within one period, without an integral.
const FlightControllerConfig kGains = {{1.485, 0.0, 0.0, 0.0, 0.0}};

class RealTime : public ::testing::Test {
 protected:
  RealTime() : core(test_vehicle(), kGains, Pacing::kRealTime) { core.take_odometry(kStart, 0.0, kStart); }
  FlightController core;
};

TEST_F(RealTime, EarlyCommandIsPassedOnAtOnceUnchanged) {
  const auto order = core.take_command(command(kStart), kStart - 0.03);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->command.stamp_s, kStart);
  EXPECT_EQ(order->command.period_s, kPeriod);
  EXPECT_EQ(order->command.duty, std::vector<double>(8, 0.4));
  EXPECT_TRUE(order->status.flying);
  EXPECT_EQ(order->status.reason, "");
  EXPECT_EQ(order->status.commands, 1u);
  EXPECT_EQ(order->status.late, 0u);
}

TEST_F(RealTime, LateCommandIsPassedOnAndCounted) {
  const auto order = core.take_command(command(kStart), kStart + 0.05);
  ASSERT_TRUE(order);
  EXPECT_TRUE(order->status.flying);
  EXPECT_EQ(order->command.duty[0], 0.4);
  EXPECT_EQ(order->status.late, 1u);
  EXPECT_EQ(order->status.expired, 0u);
}

TEST_F(RealTime, ExpiredCommandIsDroppedAndCounted) {
  EXPECT_FALSE(core.take_command(command(kStart), kStart + 0.1));
  EXPECT_FALSE(core.take_command(command(kStart), kStart + 5.0));
  EXPECT_EQ(core.status().expired, 2u);
  EXPECT_EQ(core.status().late, 0u);
}

TEST_F(RealTime, CommandOlderThanTheNewestIsDropped) {
  ASSERT_TRUE(core.take_command(command(kStart + 0.1), kStart + 0.05));
  EXPECT_FALSE(core.take_command(command(kStart), kStart + 0.06));
  EXPECT_EQ(core.status().expired, 1u);
}

TEST_F(RealTime, LaterCommandForTheSamePeriodReplacesTheEarlier) {
  ASSERT_TRUE(core.take_command(command(kStart, 0.4), kStart - 0.03));
  const auto order = core.take_command(command(kStart, 0.9), kStart + 0.01);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->command.duty[3], 0.9);
}

TEST_F(RealTime, PeriodWithoutCommandIsClosedOnceAfterTheGrace) {
  EXPECT_FALSE(core.tick(kStart + 0.5 * FlightController::kGrace_s));
  const auto order = core.tick(kStart + FlightController::kGrace_s + 0.001);
  ASSERT_TRUE(order);
  EXPECT_TRUE(all_closed(*order));
  EXPECT_NEAR(order->command.stamp_s, kStart, 1e-6);
  EXPECT_EQ(order->command.period_s, kPeriod);
  EXPECT_EQ(order->status.reason, "no command for this period");
  EXPECT_FALSE(core.tick(kStart + 0.06));
  EXPECT_FALSE(core.tick(kStart + 0.1));
  EXPECT_TRUE(core.tick(kStart + 0.125));
}

TEST_F(RealTime, EveryPeriodGetsExactlyOneOrder) {
  std::vector<int> orders(20, 0);
  const auto note = [&](const std::optional<ValveOrder>& order) {
    if (order)
      ++orders.at(static_cast<std::size_t>(std::lround((order->command.stamp_s - kStart) / kPeriod)));
  };
  for (int ms = 0; ms < 2000; ++ms) {
    const double now = kStart + 1e-3 * ms;
    if (ms % 10 == 0) core.take_odometry(now, 0.0, now);
    // Every third period goes without a command; the others' come 10 ms before or after their period's start.
    const int period = (ms + 10) / 100;
    const bool early = ms % 100 == 90 && period % 3 == 1, late = ms % 100 == 10 && period % 3 == 2;
    if ((early || late) && period < 20) note(core.take_command(command(kStart + kPeriod * period), now));
    if (ms % 5 == 0) note(core.tick(now));
  }
  EXPECT_EQ(orders, std::vector<int>(20, 1));
}

TEST_F(RealTime, LateCommandReplacesTheClosedOrder) {
  ASSERT_TRUE(core.tick(kStart + 0.03));
  const auto order = core.take_command(command(kStart), kStart + 0.04);
  ASSERT_TRUE(order);
  EXPECT_TRUE(order->status.flying);
  EXPECT_EQ(order->status.late, 1u);
}

TEST_F(RealTime, MalformedCommandsAreCountedAndThePeriodCloses) {
  std::vector<ThrusterCommand> bad(8, command(kStart));
  bad[0].duty.pop_back();
  bad[1].duty[2] = kNan;
  bad[2].duty[7] = 1.0001;
  bad[3].duty[0] = -0.0001;
  bad[4].period_s = 0.2;
  bad[5].period_s = kNan;
  bad[6].stamp_s += 0.0011;
  bad[7].stamp_s += 0.3;  // more than two periods ahead of the clock
  for (const ThrusterCommand& one : bad) EXPECT_FALSE(core.take_command(one, kStart));
  EXPECT_EQ(core.status().malformed, bad.size());

  core.take_command(bad[1], kStart);
  const auto order = core.tick(kStart + 0.03);
  ASSERT_TRUE(order);
  EXPECT_TRUE(all_closed(*order));
  EXPECT_EQ(order->status.reason, "malformed command: duty 3 is not finite");

  core.take_odometry(kStart + 0.1, 0.0, kStart + 0.1);
  const auto recovered = core.take_command(command(kStart + 0.1), kStart + 0.1);
  ASSERT_TRUE(recovered);
  EXPECT_TRUE(recovered->status.flying);
}

TEST_F(RealTime, AMalformedCommandIsTheReasonOfOnePeriodOnly) {
  ThrusterCommand bad = command(kStart);
  bad.duty.clear();
  core.take_command(bad, kStart);
  EXPECT_EQ(core.tick(kStart + 0.03)->status.reason, "malformed command: 0 duties for 8 thrusters");
  EXPECT_EQ(core.tick(kStart + 0.13)->status.reason, "no command for this period");
}

TEST_F(RealTime, StampMayLieOneMillisecondOffTheGrid) {
  const auto order = core.take_command(command(kStart + 0.0009), kStart - 0.02);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->command.stamp_s, kStart + 0.0009);
  ASSERT_TRUE(core.take_command(command(kStart + 0.1 - 0.0009), kStart + 0.05));
  EXPECT_FALSE(core.tick(kStart + 0.13)) << "the period has its command";
}

TEST_F(RealTime, FullDutiesStayWithinTheirRange) {
  const auto order = core.take_command(command(kStart, 1.0), kStart);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->command.duty, std::vector<double>(8, 1.0));
}

TEST(FlightControllerMinOnTime, ShorterPulsesAreSentAsZero) {
  for (const Pacing pacing : {Pacing::kRealTime, Pacing::kLockstep}) {
    FlightController core(test_vehicle(0.01), kGains, pacing);
    core.take_odometry(kStart, 0.0, kStart);
    ThrusterCommand sent = command(kStart, 0.5);
    sent.duty[0] = 0.099;
    sent.duty[1] = 0.1;
    sent.duty[2] = 0.0;
    const auto order = core.take_command(sent, kStart);
    ASSERT_TRUE(order);
    EXPECT_EQ(order->command.duty, (std::vector<double>{0.0, 0.1, 0.0, 0.5, 0.5, 0.5, 0.5, 0.5}));
  }
}

TEST(FlightControllerOdometry, WithoutAnyTheValvesStayClosed) {
  FlightController core(test_vehicle(), kGains, Pacing::kRealTime);
  const auto order = core.take_command(command(kStart), kStart - 0.01);
  ASSERT_TRUE(order);
  EXPECT_TRUE(all_closed(*order));
  EXPECT_EQ(order->status.reason, "no odometry yet");
  EXPECT_FALSE(core.take_command(command(kStart), kStart)) << "closed already";
}

TEST_F(RealTime, OldOdometryClosesTheValvesUntilItReturns) {
  const auto order = core.take_command(command(kStart + 0.6), kStart + 0.55);
  ASSERT_TRUE(order);
  EXPECT_TRUE(all_closed(*order));
  EXPECT_EQ(order->status.reason, "odometry is 0.60 s old");
  const auto silent = core.tick(kStart + 0.73);
  ASSERT_TRUE(silent);
  EXPECT_EQ(silent->status.reason, "odometry is 0.73 s old");

  core.take_odometry(kStart + 0.78, 0.0, kStart + 0.79);
  const auto recovered = core.take_command(command(kStart + 0.8), kStart + 0.79);
  ASSERT_TRUE(recovered);
  EXPECT_TRUE(recovered->status.flying);
  EXPECT_EQ(recovered->command.duty[0], 0.4);
}

TEST_F(RealTime, PulsesAreCutWhereOdometryBecomesTooOld) {
  core.take_odometry(kStart + 0.03, 0.0, kStart + 0.03);
  ThrusterCommand sent = command(kStart + 0.5, 1.0);
  sent.duty[1] = 0.1;
  const auto order = core.take_command(sent, kStart + 0.49);
  ASSERT_TRUE(order);
  EXPECT_NEAR(order->command.duty[0], 0.3, 1e-9);
  EXPECT_EQ(order->command.duty[1], 0.1);
  EXPECT_TRUE(order->status.flying);
}

TEST_F(RealTime, OdometryFromTheFutureCountsAsOfNow) {
  core.take_odometry(kStart + 1000.0, 0.0, kStart);
  core.take_odometry(kNan, 0.0, kStart);
  const auto order = core.take_command(command(kStart + 0.6), kStart + 0.6);
  ASSERT_TRUE(order);
  EXPECT_TRUE(all_closed(*order));
}

TEST_F(RealTime, OlderOdometryDoesNotReplaceNewer) {
  core.take_odometry(kStart + 0.3, 0.0, kStart + 0.3);
  core.take_odometry(kStart - 5.0, 0.0, kStart + 0.31);
  const auto order = core.take_command(command(kStart + 0.4), kStart + 0.4);
  ASSERT_TRUE(order);
  EXPECT_TRUE(order->status.flying);
}

TEST_F(RealTime, StartsAnewWhenTimeJumpsBack) {
  ASSERT_TRUE(core.take_command(command(kStart), kStart));
  const double again = kStart - 100.0;
  EXPECT_TRUE(core.tick(again + 0.03)) << "periods before the old newest one are served";
  core.take_odometry(again + 0.1, 0.0, again + 0.1);
  const auto order = core.take_command(command(again + 0.1), again + 0.1);
  ASSERT_TRUE(order);
  EXPECT_TRUE(order->status.flying);
}

class Lockstep : public ::testing::Test {
 protected:
  Lockstep() : core(test_vehicle(), kGains, Pacing::kLockstep) {}
  FlightController core;
};

TEST_F(Lockstep, EveryCommandIsAnsweredWhateverTheClockAndOdometrySay) {
  for (int k = 0; k < 5; ++k) {
    const auto order = core.take_command(command(kStart + kPeriod * k), kStart + 77.0 * k);
    ASSERT_TRUE(order);
    EXPECT_TRUE(order->status.flying);
    EXPECT_EQ(order->command.stamp_s, kStart + kPeriod * k);
  }
  EXPECT_EQ(core.status().late, 0u);
  EXPECT_FALSE(core.tick(kStart + 10.03));
}

TEST_F(Lockstep, MalformedCommandIsAnsweredWithClosedValves) {
  ThrusterCommand bad = command(kStart);
  bad.duty[4] = std::numeric_limits<double>::infinity();
  const auto order = core.take_command(bad, kStart);
  ASSERT_TRUE(order);
  EXPECT_TRUE(all_closed(*order));
  EXPECT_NEAR(order->command.stamp_s, kStart, 1e-9);
  EXPECT_EQ(order->status.reason, "malformed command: duty 5 is not finite");
  EXPECT_EQ(order->status.malformed, 1u);

  ThrusterCommand off_grid = command(kStart + 0.103);
  const auto nearest = core.take_command(off_grid, kStart);
  ASSERT_TRUE(nearest);
  EXPECT_TRUE(all_closed(*nearest));
  EXPECT_NEAR(nearest->command.stamp_s, kStart + 0.1, 1e-9);
  EXPECT_TRUE(core.take_command(command(kStart + 0.2), kStart)->status.flying);
  bad.stamp_s = kStart + 0.2;
  EXPECT_FALSE(core.take_command(bad, kStart)) << "this period has been answered";
}

TEST_F(Lockstep, PeriodIsAnsweredOnce) {
  ASSERT_TRUE(core.take_command(command(kStart + 0.1), kStart));
  EXPECT_FALSE(core.take_command(command(kStart + 0.1, 0.9), kStart));
  EXPECT_FALSE(core.take_command(command(kStart), kStart));
  EXPECT_EQ(core.status().expired, 2u);
}

TEST_F(Lockstep, WrenchIsAllocated) {
  const BodyWrench wrench(1.0, -0.5, 0.1);
  const auto order = core.take_wrench(kStart, wrench, kStart);
  ASSERT_TRUE(order);
  EXPECT_TRUE(order->status.flying);
  EXPECT_EQ(order->command.stamp_s, kStart);
  EXPECT_EQ(order->command.period_s, kPeriod);
  EXPECT_EQ(order->command.duty, Allocator(test_vehicle()).allocate(wrench).duty);
  EXPECT_EQ(core.take_wrench(kStart + 0.1, BodyWrench::Zero(), kStart)->command.duty,
            std::vector<double>(8, 0.0));
  EXPECT_EQ(core.status().scaled, 0u);
}

TEST_F(Lockstep, WrenchBeyondTheThrustersIsScaledAndCounted) {
  const BodyWrench wrench(30.0, 0.0, 1.0);
  const auto order = core.take_wrench(kStart, wrench, kStart);
  ASSERT_TRUE(order);
  EXPECT_TRUE(order->status.flying);
  EXPECT_EQ(order->status.scaled, 1u);
  const BodyWrench achieved = Allocator(test_vehicle()).allocate(wrench).achieved;
  EXPECT_LT(achieved.normalized().cross(wrench.normalized()).norm(), 1e-9);
}

TEST_F(Lockstep, WrenchThatIsNotFiniteIsAnsweredWithClosedValves) {
  const auto order = core.take_wrench(kStart, {1.0, kNan, 0.0}, kStart);
  ASSERT_TRUE(order);
  EXPECT_TRUE(all_closed(*order));
  EXPECT_EQ(order->status.reason, "malformed command: wrench is not finite");
  EXPECT_EQ(order->status.malformed, 1u);
  EXPECT_EQ(order->status.scaled, 0u);
}

TEST_F(RealTime, WrenchObeysTheRulesOfTheClock) {
  EXPECT_TRUE(core.take_wrench(kStart, {0.5, 0.0, 0.0}, kStart - 0.02));
  EXPECT_FALSE(core.take_wrench(kStart, {0.5, 0.0, 0.0}, kStart + 0.1)) << "its period is over";
  EXPECT_FALSE(core.take_wrench(kStart + 0.203, {0.5, 0.0, 0.0}, kStart + 0.15)) << "off the grid";
  EXPECT_EQ(core.status().expired, 1u);
  EXPECT_EQ(core.status().malformed, 1u);
  // A wrench replaces a thruster command for the same period and the other way round.
  ASSERT_TRUE(core.take_command(command(kStart + 0.2, 0.9), kStart + 0.15));
  EXPECT_LT(core.take_wrench(kStart + 0.2, {0.5, 0.0, 0.0}, kStart + 0.16)->command.duty[0], 0.9);
}

TEST_F(Lockstep, RateBecomesTorqueAndForceStays) {
  core.take_odometry(kStart, -0.1, kStart);
  const auto order = core.take_rate(kStart, {0.4, 0.0}, 0.1, kStart);
  ASSERT_TRUE(order);
  EXPECT_TRUE(order->status.flying);
  const Allocation expected = Allocator(test_vehicle()).allocate({0.4, 0.0, 1.485 * 0.2});
  for (std::size_t i = 0; i < expected.duty.size(); ++i)
    EXPECT_NEAR(order->command.duty[i], expected.duty[i], 1e-12) << i;
}

TEST_F(Lockstep, RateMeasuredTooLongAgoGivesNoTorque) {
  core.take_odometry(kStart, 0.5, kStart);
  ASSERT_TRUE(core.take_rate(kStart, {0.0, 0.0}, 0.0, kStart));
  const auto order = core.take_rate(kStart + 0.2, {0.0, 0.0}, 0.0, kStart + 0.2);
  ASSERT_TRUE(order);
  for (const double duty : order->command.duty) EXPECT_EQ(duty, 0.0);
}

TEST_F(Lockstep, RateThatIsNotFiniteClosesTheValves) {
  core.take_odometry(kStart, 0.5, kStart);
  for (int k = 0; k < 3; ++k) {
    const double stamp = kStart + 0.1 * k;
    const auto order =
        core.take_rate(stamp, {k == 0 ? kNan : 0.0, k == 1 ? kNan : 0.0}, k == 2 ? kNan : 0.0, stamp);
    ASSERT_TRUE(order);
    EXPECT_FALSE(order->status.flying);
    for (const double duty : order->command.duty) EXPECT_EQ(duty, 0.0);
  }
  EXPECT_EQ(core.status().malformed, 3U);
}

// Mean force and torque about the centre of mass over one period of the plant with `effects`.
BodyWrench mean_wrench(const Plant& plant, const std::vector<double>& duty) {
  constexpr int kSteps = 1000;
  BodyWrench sum = BodyWrench::Zero();
  VecX<double> openings(static_cast<Eigen::Index>(duty.size()));
  for (int k = 0; k < kSteps; ++k) {
    for (std::size_t i = 0; i < duty.size(); ++i)
      openings[static_cast<Eigen::Index>(i)] = (k + 0.5) / kSteps < duty[i] ? 1.0 : 0.0;
    const PlanarWrench<double> now = plant.wrench<double>(kStart, {}, plant.initial_hidden(), openings);
    sum += BodyWrench(now.force_W[0], now.force_W[1], now.torque) / kSteps;
  }
  return sum;
}

TEST(Model, WrenchesAreRealWithAnyOneThrusterDeadAWeakOneAndACoupledSupply) {
  for (int dead = 1; dead <= 8; ++dead) {
    SupplyCoupling coupling;
    coupling.fraction_per_open_thruster = 0.125;
    ThrusterDead gone;
    gone.thruster = dead;
    ThrusterEfficiency weak;
    weak.thruster = dead % 8 + 1;
    weak.factor = 0.8;
    FlightControllerConfig config = kGains;
    config.model = {weak, gone, coupling};
    FlightController core(test_vehicle(), config, Pacing::kLockstep);
    FlightController nominal(test_vehicle(), kGains, Pacing::kLockstep);
    const Plant plant(test_vehicle(), config.model, kStart);
    double nominal_error = 0.0;
    double stamp = kStart;
    for (const BodyWrench& wrench :
         {BodyWrench(0.4, -0.3, 0.02), BodyWrench(-0.5, 0.2, -0.03), BodyWrench(0.1, 0.6, 0.0),
          BodyWrench(0.0, 0.0, 0.08), BodyWrench(0.0, 0.0, -0.08)}) {
      const auto order = core.take_wrench(stamp, wrench, stamp);
      ASSERT_TRUE(order);
      // The plant is told of death by timing, not by force.
      EXPECT_EQ(order->command.duty[static_cast<std::size_t>(dead - 1)], 0.0);
      EXPECT_LT((mean_wrench(plant, order->command.duty) - wrench).norm(), 0.01) << dead;
      std::vector<double> unaware = nominal.take_wrench(stamp, wrench, stamp)->command.duty;
      unaware[static_cast<std::size_t>(dead - 1)] = 0.0;
      nominal_error = std::max(nominal_error, (mean_wrench(plant, unaware) - wrench).norm());
      stamp += kPeriod;
    }
    EXPECT_GT(nominal_error, 0.1);
  }
}

}  // namespace
}  // namespace atmos
