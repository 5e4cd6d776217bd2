// Advanced-step feedback in the controller: where it answers, where the problem is solved instead, and what
// it costs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "atmos_nmpc/config.h"
#include "closed_loop.h"

namespace atmos {
namespace {

using testing::kDegree;
using testing::kLabNoise;
using testing::kStart;

using testing::Flight;
using testing::FlightRow;
using testing::planar_goal;

constexpr double kPeriod = 0.1;

class FeedbackTest : public ::testing::Test {
 protected:
  ControllerConfig config(const std::string& name) const {
    return load_controller(std::string(ATMOS_CONFIG_DIR) + "/controller/" + name + ".yaml", vehicle_);
  }
  std::unique_ptr<Controller> controller(const ControllerConfig& config) {
    auto made = std::make_unique<Controller>(vehicle_, config, true,
                                             [this] { return clock_ += solver_fails_ ? 1.0 : 0.0; });
    made->add_goal(planar_goal(kStart, 0.5, 0.0, 0.0));
    return made;
  }

  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  double clock_ = 0.0;
  bool solver_fails_ = false;
};

TEST_F(FeedbackTest, AnswersEveryPeriodButTheFirst) {
  for (const char* name :
       {"direct_allocation", "wrench", "offset_free_direct_allocation", "offset_free_wrench"}) {
    const auto tested = controller(config(name));
    Flight robot(vehicle_, *tested, kStart, {}, kLabNoise, 3);
    EXPECT_FALSE(robot.period().decision.feedback) << name;
    int answered = 0;
    for (int k = 1; k < 200; ++k) {
      const ControlDecision decision = robot.period().decision;
      EXPECT_EQ(decision.mode, ControlMode::kSolved) << name << ", period " << k;
      EXPECT_TRUE(is_success(decision.solve.status));
      EXPECT_EQ(decision.path.size(), 21u);
      answered += decision.feedback ? 1 : 0;
    }
    EXPECT_GE(answered, 190) << name;
    EXPECT_EQ(tested->counters().feedbacks, static_cast<std::uint64_t>(answered)) << name;
    EXPECT_NEAR(robot.truth().p_WC.x(), 0.5, 0.005) << name;
  }
}

TEST_F(FeedbackTest, NeverWithFullSolvesConfigured) {
  ControllerConfig full = config("direct_allocation");
  full.feedback = FeedbackKind::kFull;
  const auto tested = controller(full);
  Flight robot(vehicle_, *tested, kStart, {}, kLabNoise, 3);
  for (int k = 0; k < 20; ++k) EXPECT_FALSE(robot.period().decision.feedback);
  EXPECT_EQ(tested->counters().solves, 20u);
}

TEST_F(FeedbackTest, AChangedReferenceIsSolvedForInItsPeriod) {
  const auto tested = controller(config("direct_allocation"));
  Flight robot(vehicle_, *tested, kStart, {}, kLabNoise, 3);
  for (int k = 0; k < 100; ++k) robot.period();
  tested->add_goal(planar_goal(robot.now(), 0.0, 0.0, 0.0));
  FlightRow row = robot.period();
  EXPECT_EQ(row.decision.mode, ControlMode::kSolved);
  EXPECT_FALSE(row.decision.feedback);
  EXPECT_GT(row.decision.command.duty[1], 0.5);  // thruster 2 pushes backward: the new set-point acts already
  EXPECT_TRUE(robot.period().decision.feedback);

  // Announced ahead, it is prepared for and answered at once.
  tested->add_goal(planar_goal(robot.now() + 5.0 * kPeriod, 0.5, 0.0, 0.0));
  for (int k = 0; k < 5; ++k) EXPECT_TRUE(robot.period().decision.feedback);
  row = robot.period();
  EXPECT_TRUE(row.decision.feedback);
  EXPECT_GT(row.decision.command.duty[0], 0.4);
}

TEST_F(FeedbackTest, AJumpIsSolvedForAndNotExtrapolated) {
  const auto tested = controller(config("direct_allocation"));
  Flight robot(vehicle_, *tested, kStart, {}, {}, 3);
  for (int k = 0; k < 100; ++k) robot.period();
  PlanarState<double> kicked = robot.truth();
  kicked.v_WC.y() += 0.2;
  Flight after(vehicle_, *tested, robot.now(), kicked, {}, 3);
  const ControlDecision decision = after.period().decision;
  EXPECT_EQ(decision.mode, ControlMode::kSolved);
  EXPECT_FALSE(decision.feedback);
  EXPECT_TRUE(after.period().decision.feedback);
}

TEST_F(FeedbackTest, AMissingFrameIsAnsweredAndAMissedPeriodSolvedFor) {
  const auto tested = controller(config("direct_allocation"));
  Flight robot(vehicle_, *tested, kStart, {}, {}, 3);
  for (int k = 0; k < 10; ++k) robot.period();
  EXPECT_TRUE(robot.period(false).decision.feedback);
  for (int k = 0; k < 10; ++k) robot.period();
  const ControlDecision* late = tested->on_odometry(
      {robot.now() + kPeriod, testing::state13_of(robot.truth()), true}, robot.now() + kPeriod);
  ASSERT_TRUE(late);
  EXPECT_EQ(late->mode, ControlMode::kSolved);
  EXPECT_FALSE(late->feedback);
}

TEST_F(FeedbackTest, AfterALossNothingPreparedIsLeft) {
  const auto tested = controller(config("offset_free_wrench"));
  Flight robot(vehicle_, *tested, kStart, {}, kLabNoise, 3);
  for (int k = 0; k < 20; ++k) robot.period();
  for (int k = 0; k < 8; ++k) robot.period(false);
  const ControlDecision back = robot.period().decision;
  EXPECT_EQ(back.mode, ControlMode::kSolved);
  EXPECT_FALSE(back.feedback);
}

TEST_F(FeedbackTest, AFailedPreparationLeavesThePeriodItsOwnSolve) {
  Controller timed(vehicle_, config("direct_allocation"), false,
                   [this] { return clock_ += solver_fails_ ? 1.0 : 0.0; });
  timed.add_goal(planar_goal(kStart, 0.5, 0.0, 0.0));
  Flight again(vehicle_, timed, kStart, {}, {}, 3);
  for (int k = 0; k < 20; ++k) again.period();
  solver_fails_ = true;
  EXPECT_TRUE(again.period().decision.feedback);  // prepared while all was well; now the next one fails
  EXPECT_EQ(timed.counters().solver_failures, 1u);
  solver_fails_ = false;
  ControlDecision decision = again.period().decision;
  EXPECT_EQ(decision.mode, ControlMode::kSolved);
  EXPECT_FALSE(decision.feedback);

  again.period();
  solver_fails_ = true;
  again.period();
  for (int k = 1; k <= 5; ++k) {
    decision = again.period().decision;
    EXPECT_EQ(decision.mode, ControlMode::kPreviousPlan) << k;
    EXPECT_EQ(decision.solve.status, SolverStatus::kTimeLimit);
    EXPECT_FALSE(decision.feedback);
  }
  EXPECT_EQ(again.period().decision.mode, ControlMode::kBraking);
}

TEST_F(FeedbackTest, StaysWithinTheInputsBounds) {
  const auto tested = controller(config("direct_allocation"));
  tested->add_goal(planar_goal(kStart, 3.0, -2.0, 1.0));
  testing::Noise rough = kLabNoise;
  rough.velocity_m_s = 0.01;
  Flight robot(vehicle_, *tested, kStart, {}, rough, 3);
  double most = 0.0;
  int feedbacks = 0;
  for (int k = 0; k < 100; ++k) {
    const ControlDecision decision = robot.period().decision;
    feedbacks += decision.feedback ? 1 : 0;
    for (const double duty : decision.command.duty) {
      ASSERT_GE(duty, 0.0);
      most = std::max(most, duty);
    }
  }
  EXPECT_GT(feedbacks, 50);
  EXPECT_LE(most, 1.5 / 1.7 + 1e-9);
  EXPECT_GT(most, 0.85);
}

// What a flight cost: the weights of the configuration over truth and inputs.
class FeedbackCost : public FeedbackTest {
 protected:
  struct Outcome {
    double cost = 0.0;
    int feedbacks = 0;
  };
  // Four set-points, unannounced. `disturbed`: every two seconds another slope and a kick.
  Outcome fly(const ControllerConfig& config, bool disturbed, std::uint32_t seed) {
    const auto tested = controller(config);
    TrackingCost tracking(config.attitude_error, config.weights, config.bounds);
    const double poses[4][3] = {{1, 0, 0}, {1, 1, 0}, {1, 1, 45 * kDegree}, {0, 0, 0}};
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    PlanarState<double> at;
    Outcome outcome;
    for (int segment = 0; segment < 20; ++segment) {
      const double now = kStart + 2.0 * segment;
      const double* pose = poses[segment / 5];
      if (segment % 5 == 0) tested->add_goal(planar_goal(now, pose[0], pose[1], pose[2]));
      std::vector<Effect> effects;
      if (disturbed) {
        FloorTilt tilt;
        tilt.slope_x = 0.002 * normal(random);
        tilt.slope_y = 0.002 * normal(random);
        effects.push_back(tilt);
        at.v_WC += 0.02 * Eigen::Vector2d(normal(random), normal(random));
        at.yaw_rate += 0.05 * normal(random);
      }
      Flight robot(vehicle_, *tested, now, at, kLabNoise, seed + static_cast<std::uint32_t>(segment),
                   effects);
      for (int k = 0; k < 20; ++k) {
        const FlightRow row = robot.period();
        EXPECT_EQ(row.decision.mode, ControlMode::kSolved);
        const State13<double> x = testing::state13_of(row.truth);
        State13<double> reference = State13<double>::Zero();
        reference.segment<2>(0) << pose[0], pose[1];
        reference[state13::kQuaternion] = std::cos(0.5 * pose[2]);
        reference[state13::kQuaternion + 3] = std::sin(0.5 * pose[2]);
        tracking.set_reference(reference, x.segment<4>(state13::kQuaternion),
                               TrackingCost::PlanarWeight::Zero());
        outcome.cost += tracking.value(x, 0, false);
        if (config.formulation == FormulationKind::kWrench) {
          outcome.cost += config.force_weight * row.decision.wrench.head<2>().squaredNorm() +
                          config.torque_weight * row.decision.wrench[2] * row.decision.wrench[2];
        } else {
          for (const double duty : row.decision.command.duty)
            outcome.cost += config.force_weight * std::pow(1.7 * duty, 2);
        }
        outcome.feedbacks += row.decision.feedback ? 1 : 0;
      }
      at = robot.truth();
    }
    return outcome;
  }
};

TEST_F(FeedbackCost, WithinOnePercentOfTheConvergedController) {
  for (const char* name : {"direct_allocation", "wrench", "offset_free_wrench"}) {
    for (const bool disturbed : {false, true}) {
      for (const std::uint32_t seed : {disturbed ? 200u : 100u}) {
        const Outcome feedback = fly(config(name), disturbed, seed);
        ControllerConfig converged = config(name);
        converged.feedback = FeedbackKind::kFull;
        converged.solver.max_iterations = 300;
        converged.solver.ipopt["tol"] = "1e-9";
        converged.solver.ipopt["mu_init"] = "1e-4";
        const Outcome best = fly(converged, disturbed, seed);
        EXPECT_EQ(best.feedbacks, 0);
        EXPECT_GT(feedback.feedbacks, 350) << name;  // of 400
        EXPECT_LT(feedback.cost, 1.01 * best.cost) << name << (disturbed ? ", disturbed" : "");
        EXPECT_GT(feedback.cost, 0.97 * best.cost) << name << ": so much better is a fault of the measure";
        std::printf("%s%s, seed %u: cost ratio %.5f, %d of 400 by feedback\n", name,
                    disturbed ? ", disturbed" : "", seed, feedback.cost / best.cost, feedback.feedbacks);
      }
    }
  }
}

}  // namespace
}  // namespace atmos
