// Timing, loss rules and bad data, one test each.
#include "atmos_nmpc/controller.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "atmos_nmpc/config.h"
#include "atmos_nmpc/direct_allocation.h"
#include "closed_loop.h"

namespace atmos {
namespace {

using testing::Flight;
using testing::planar_goal;

constexpr double kStart = 1234.5, kPeriod = 0.1;

bool closed(const ControlDecision& decision) {
  return std::all_of(decision.command.duty.begin(), decision.command.duty.end(),
                     [](double d) { return d == 0.0; });
}

class ControllerTest : public ::testing::Test {
 protected:
  ControllerTest() { make(); }
  void make() {
    controller_ = std::make_unique<Controller>(vehicle_, config_, false,
                                               [this] { return clock_ += solver_fails_ ? 1.0 : 0.0; });
    controller_->add_goal(planar_goal(kStart, 1.0, 0.0, 0.0));
  }
  Flight flight(const PlanarState<double>& start = {}) {
    return Flight(vehicle_, *controller_, kStart, start, {}, 1);
  }
  OdometrySample sample(double stamp) const { return {stamp, testing::state13_of({}), true}; }

  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  ControllerConfig config_ = [this] {
    ControllerConfig config =
        load_controller(ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml", vehicle_);
    config.lead_s = 0.0;
    config.feedback =
        FeedbackKind::kFull;  // the rules are those of a period's own solve; feedback_test has the rest
    return config;
  }();
  double clock_ = 0.0;
  bool solver_fails_ = false;  // every look at the clock costs a second: each solve hits its time limit
  std::unique_ptr<Controller> controller_;
};

TEST_F(ControllerTest, SolvesOncePerPeriodOnTheGrid) {
  int decisions = 0;
  for (int k = 0; k < 100; ++k) {
    const double stamp = kStart + 0.01 * k;
    const auto decision = controller_->on_odometry(sample(stamp), stamp);
    EXPECT_EQ(decision != nullptr, k % 10 == 0) << k;
    if (!decision) continue;
    ++decisions;
    EXPECT_NEAR(decision->command.stamp_s, stamp, 1e-9);
    EXPECT_EQ(decision->command.period_s, kPeriod);
    EXPECT_EQ(decision->mode, ControlMode::kSolved);
  }
  EXPECT_EQ(decisions, 10);
}

TEST_F(ControllerTest, TakesTheFirstOdometryWithinAMillisecondOfThePeriod) {
  ASSERT_TRUE(controller_->on_odometry(sample(kStart), kStart));
  EXPECT_FALSE(controller_->on_odometry(sample(kStart + 0.0985), kStart + 0.1));
  const auto decision = controller_->on_odometry(sample(kStart + 0.0995), kStart + 0.1);
  ASSERT_TRUE(decision);
  EXPECT_NEAR(decision->command.stamp_s, kStart + 0.1, 1e-9);
}

TEST_F(ControllerTest, LeadSolvesForTheNextPeriodFromThePredictedState) {
  config_.lead_s = 0.02;
  make();
  State13<double> x = testing::state13_of({{0.0, 0.0}, 0.0, {0.5, 0.0}, 0.0});
  const auto decision = controller_->on_odometry({kStart + 0.08, x, true}, kStart + 0.08);
  ASSERT_TRUE(decision);
  EXPECT_NEAR(decision->command.stamp_s, kStart + 0.1, 1e-9);
  EXPECT_NEAR(decision->path.front()[0], 0.5 * 0.02, 1e-9);
}

TEST_F(ControllerTest, PredictsThroughItsOwnCommands) {
  // Two flights from rest towards the goal; in the second the frame of the third period is missing.
  Flight with = flight();
  testing::FlightRow seen{}, missed{};
  for (int k = 0; k < 3; ++k) seen = with.period();
  make();
  Flight without = flight();
  for (int k = 0; k < 3; ++k) missed = without.period(k < 2);
  EXPECT_EQ(missed.decision.odometry, OdometryState::kFresh);
  EXPECT_NEAR(missed.decision.odometry_age_s, 0.1, 1e-9);
  EXPECT_LT((missed.decision.path.front() - seen.decision.path.front()).norm(), 1e-6);
}

TEST_F(ControllerTest, OdometryOlderThanATenthIsMarkedAndOlderThanAHalfClosesTheValves) {
  Flight robot = flight();
  for (int k = 0; k < 10; ++k) robot.period();
  for (int k = 1; k <= 20; ++k) {
    const auto row = robot.period(false);
    const OdometryState expected = k <= 1   ? OdometryState::kFresh
                                   : k <= 5 ? OdometryState::kPredicted
                                            : OdometryState::kLost;
    EXPECT_EQ(row.decision.odometry, expected) << k;
    EXPECT_EQ(row.decision.mode, k <= 5 ? ControlMode::kSolved : ControlMode::kClosed) << k;
    EXPECT_TRUE(k <= 5 || closed(row.decision)) << k;
  }
  // Recovery by itself, and the flight goes on to the goal.
  EXPECT_EQ(robot.period().decision.mode, ControlMode::kSolved);
  for (int k = 0; k < 150; ++k) robot.period();
  EXPECT_NEAR(robot.truth().p_WC.x(), 1.0, 0.01);
}

TEST_F(ControllerTest, FailingSolverFollowsThePlanThenBrakesThenCloses) {
  Flight robot = flight();
  for (int k = 0; k < 20; ++k) robot.period();
  const ControlDecision last = robot.period().decision;
  const double speed = robot.truth().v_WC.norm();
  ASSERT_GT(speed, 0.2);

  solver_fails_ = true;
  for (int k = 1; k <= 5; ++k) {
    const ControlDecision decision = robot.period().decision;
    EXPECT_EQ(decision.mode, ControlMode::kPreviousPlan) << k;
    EXPECT_EQ(decision.solve.status, SolverStatus::kTimeLimit);
    EXPECT_TRUE(decision.path.empty());
    EXPECT_FALSE(closed(decision)) << k;  // the plan is still pushing or braking hard
  }
  EXPECT_EQ(last.mode, ControlMode::kSolved);
  int braking = 0;
  ControlDecision decision = robot.period().decision;
  for (; decision.mode == ControlMode::kBraking; decision = robot.period().decision) ASSERT_LT(++braking, 51);
  EXPECT_GT(braking, 5);
  EXPECT_EQ(decision.mode, ControlMode::kClosed);
  EXPECT_TRUE(closed(decision));
  EXPECT_LT(robot.truth().v_WC.norm(), config_.limits.rest_speed_m_s);
  EXPECT_EQ(controller_->counters().solver_failures, static_cast<std::uint64_t>(5 + braking + 1));

  solver_fails_ = false;
  EXPECT_EQ(robot.period().decision.mode, ControlMode::kSolved);
}

TEST_F(ControllerTest, BrakingStopsTranslationAndSpin) {
  solver_fails_ = true;
  Flight robot = flight({{0.0, 0.0}, 0.5, {0.2, -0.3}, 1.0});
  EXPECT_EQ(robot.period().decision.mode, ControlMode::kBraking);  // there is no plan to follow
  for (int k = 0; k < 49; ++k) robot.period();
  EXPECT_LT(robot.truth().v_WC.norm(), 0.01);
  EXPECT_LT(std::abs(robot.truth().yaw_rate), 0.05);
}

TEST_F(ControllerTest, BrakingEndsAfterFiveSeconds) {
  solver_fails_ = true;
  Flight robot = flight({{0.0, 0.0}, 0.0, {3.0, 0.0}, 0.0});  // far too fast to be stopped in time
  for (int k = 0; k < 50; ++k) ASSERT_EQ(robot.period().decision.mode, ControlMode::kBraking) << k;
  const ControlDecision decision = robot.period().decision;
  EXPECT_EQ(decision.mode, ControlMode::kClosed);
  EXPECT_TRUE(closed(decision));
}

TEST_F(ControllerTest, DoesNotBrakeOnAGuessedVelocity) {
  Flight robot = flight({{0.0, 0.0}, 0.0, {0.2, 0.0}, 0.0});
  solver_fails_ = true;
  robot.period();
  robot.period(false);
  const ControlDecision decision = robot.period(false).decision;
  EXPECT_EQ(decision.odometry, OdometryState::kPredicted);
  EXPECT_EQ(decision.mode, ControlMode::kClosed);
}

TEST_F(ControllerTest, BadOdometryIsCountedAndIgnored) {
  Flight robot = flight();
  for (int k = 0; k < 3; ++k) robot.period();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  OdometrySample bad = sample(kStart + 0.3);
  bad.x[3] = nan;
  const auto decision = controller_->on_odometry(bad, kStart + 0.3);
  ASSERT_TRUE(decision);  // the period gets its command from the prediction
  EXPECT_EQ(decision->mode, ControlMode::kSolved);
  EXPECT_NEAR(decision->odometry_age_s, 0.1, 1e-9);

  bad = sample(kStart + 0.31);
  bad.x.segment<4>(state13::kQuaternion).setZero();
  EXPECT_FALSE(controller_->on_odometry(bad, kStart + 0.31));
  EXPECT_FALSE(controller_->on_odometry(sample(nan), kStart + 0.31));
  EXPECT_EQ(controller_->counters().rejected_not_finite, 3u);

  EXPECT_FALSE(controller_->on_odometry(sample(kStart + 0.1), kStart + 0.32));
  EXPECT_FALSE(controller_->on_odometry(sample(kStart + 1e6), kStart + 0.32));
  EXPECT_EQ(controller_->counters().rejected_order, 2u);

  bad = sample(kStart + 0.35);
  bad.frames_match = false;
  EXPECT_FALSE(controller_->on_odometry(bad, kStart + 0.35));
  EXPECT_EQ(controller_->counters().rejected_frame, 1u);

  const auto next = controller_->on_odometry(sample(kStart + 0.4), kStart + 0.4);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->odometry_age_s, 0.0);
}

TEST_F(ControllerTest, WaitsForOdometryAndForASetPointInForce) {
  auto decision = controller_->on_missing_frame(kStart);
  ASSERT_TRUE(decision);
  EXPECT_EQ(decision->mode, ControlMode::kWaiting);
  EXPECT_EQ(decision->odometry, OdometryState::kNone);
  EXPECT_TRUE(closed(*decision));

  Controller later(vehicle_, config_, false, [] { return 0.0; });
  later.add_goal(planar_goal(kStart + 0.2, 1.0, 0.0, 0.0));
  for (int k = 0; k < 3; ++k) {
    decision = later.on_odometry(sample(kStart + 0.1 * k), kStart + 0.1 * k);
    ASSERT_TRUE(decision);
    EXPECT_EQ(decision->mode, k < 2 ? ControlMode::kWaiting : ControlMode::kSolved) << k;
  }
}

TEST_F(ControllerTest, SetPointsHoldFromTheirStampsAndNewerOnesAtOnce) {
  controller_->add_goal(planar_goal(kStart + 0.2, -1.0, 0.0, 0.0));
  const auto push = [this](int k) {
    const auto decision = controller_->on_odometry(sample(kStart + 0.1 * k), kStart + 0.1 * k);
    return decision->command.duty[0] - decision->command.duty[1];  // thruster 1 pushes forward, 2 backward
  };
  EXPECT_GT(push(0), 0.1);
  EXPECT_GT(push(1), 0.1);
  EXPECT_LT(push(2), -0.1);
  controller_->add_goal(planar_goal(0.0, 1.0, 0.0, 0.0));
  EXPECT_GT(push(3), 0.1);
  controller_->add_goal({kStart, {std::numeric_limits<double>::quiet_NaN(), 0, 0}, {1, 0, 0, 0}});
  controller_->add_goal({kStart, {0, 0, 0}, {0, 0, 0, 0}});
  EXPECT_EQ(controller_->counters().rejected_goals, 2u);
  EXPECT_GT(push(4), 0.1);
}

TEST_F(ControllerTest, WatchdogCoversASilentBridge) {
  ASSERT_TRUE(controller_->on_odometry(sample(kStart), kStart));
  EXPECT_FALSE(controller_->on_silence(kStart + 0.05));
  EXPECT_FALSE(controller_->on_silence(kStart + 0.15));
  int decisions = 0;
  for (int k = 20; k < 100; ++k) {
    const auto decision = controller_->on_silence(kStart + 0.01 * k);
    if (!decision) continue;
    ++decisions;
    EXPECT_EQ(closed(*decision) && decision->mode == ControlMode::kClosed, k >= 60) << k;
  }
  EXPECT_EQ(decisions, 8);  // every period from the third on
  const auto back = controller_->on_odometry(sample(kStart + 1.0), kStart + 1.0);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->mode, ControlMode::kSolved);
  EXPECT_FALSE(controller_->on_silence(kStart + 1.1));
}

TEST_F(ControllerTest, DutiesFollowThePairsSignAndTheThrustersForce) {
  const auto pairs = thruster_pairs(vehicle_);
  Vehicle vehicle = vehicle_;
  vehicle.pwm.min_on_time_s = 0.01;
  std::vector<double> duty;
  duties_from_pairs(vehicle, pairs, {0.85, -1.7, 0.1, -3.0}, duty);
  std::vector<double> expected(8, 0.0);
  expected[static_cast<std::size_t>(pairs[0].positive)] = 0.5;
  expected[static_cast<std::size_t>(pairs[1].negative)] = 1.0;
  expected[static_cast<std::size_t>(pairs[3].negative)] =
      1.0;  // the third is under the shortest pulse, the last over full
  for (std::size_t i = 0; i < 8; ++i) EXPECT_DOUBLE_EQ(duty[i], expected[i]) << i;
}

}  // namespace
}  // namespace atmos
