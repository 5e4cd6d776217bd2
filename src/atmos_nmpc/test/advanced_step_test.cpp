#include "atmos_nmpc/advanced_step.h"

#include <gtest/gtest.h>

#include <random>

#include "atmos_nmpc/config.h"
#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/solver.h"
#include "atmos_nmpc/terminal_weight.h"
#include "numeric.h"

namespace atmos {
namespace {

using State = State13<double>;

class AdvancedStepTest : public ::testing::Test {
 protected:
  AdvancedStepTest() {
    x0_ = State::Zero();
    x0_.head<2>() << -0.25, 0.1;
    x0_.segment<4>(state13::kQuaternion) = testing::about_axis({0, 0, 1}, 0.2);
    x0_[state13::kVelocity] = 0.05;
    State reference = State::Zero();
    reference[state13::kQuaternion] = 1.0;
    problem_.cost().set_reference(
        reference, x0_.segment<4>(state13::kQuaternion),
        planar_terminal_weight(problem_.dynamics(), config_.weights, problem_.input_weight(), 0.0));
  }

  Iterate solution(const State& x0) {
    problem_.set_initial_state(x0);
    Iterate iterate = problem_.cold_start(1e-4);
    EXPECT_EQ(solver_.solve(iterate).status, SolverStatus::kSolved);
    return iterate;
  }

  static ControllerConfig config(const Vehicle& vehicle) {
    ControllerConfig config = load_controller(ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml", vehicle);
    config.solver.max_iterations = 200;
    // A barrier that does not end at zero keeps the solution differentiable where inputs saturate.
    config.solver.ipopt = {{"tol", "1e-9"}, {"mu_target", "1e-5"}, {"mu_init", "1e-4"}};
    return config;
  }

  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const ControllerConfig config_ = config(vehicle_);
  DirectAllocation problem_ = make_direct_allocation(vehicle_, config_);
  OptimalControlSolver solver_{problem_, config_.solver, [] { return 1234.5; }};
  AdvancedStep<DirectAllocation> feedback_{problem_};
  State x0_;
};

TEST_F(AdvancedStepTest, IsTheSolutionAtThePredictedState) {
  const Iterate plan = solution(x0_);
  EXPECT_FALSE(feedback_.ready());
  ASSERT_TRUE(feedback_.prepare(problem_, plan));
  EXPECT_EQ(feedback_.input(), problem_.input(plan.z, 0));
  EXPECT_EQ(feedback_.correction(x0_, problem_), Eigen::Vector4d::Zero());
  State other_sign = x0_;
  other_sign.segment<4>(state13::kQuaternion) *= -1.0;
  EXPECT_EQ(feedback_.correction(other_sign, problem_), Eigen::Vector4d::Zero());
  feedback_.forget();
  EXPECT_FALSE(feedback_.ready());
}

TEST_F(AdvancedStepTest, ErrorIsOfSecondOrderInTheDeviation) {
  const Iterate plan = solution(x0_);
  ASSERT_TRUE(feedback_.prepare(problem_, plan));
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 10; ++trial) {
    State direction;
    for (int i = 0; i < 13; ++i) direction[i] = normal(random);
    direction.normalize();
    double error[2], change[2];
    for (int i = 0; i < 2; ++i) {
      const State x0 = x0_ + (i == 0 ? 2e-3 : 1e-3) * direction;
      const Eigen::Vector4d u = problem_.input(solution(x0).z, 0);
      error[i] = (feedback_.input() + feedback_.correction(x0, problem_) - u).norm();
      change[i] = (u - problem_.input(plan.z, 0)).norm();
    }
    EXPECT_LT(error[1], 0.35 * error[0] + 1e-7) << "trial " << trial;
    EXPECT_LT(error[1], 0.1 * change[1] + 1e-7) << "trial " << trial;
  }
}

TEST_F(AdvancedStepTest, ErrorIsOfSecondOrderInTheDisturbance) {
  const Disturbance before{{0.02, -0.01, 0.0}, {0.0, 0.0, 0.03}};
  const auto disturb = [this](const Disturbance& d) {
    problem_.set_disturbance(d);
    problem_.set_input_reference(
        problem_.dynamics().holding_input(problem_.cost().reference().segment<4>(state13::kQuaternion)));
  };
  disturb(before);
  const Iterate plan = solution(x0_);
  ASSERT_TRUE(feedback_.prepare(problem_, plan));
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 10; ++trial) {
    Eigen::Vector3d direction(normal(random), normal(random), normal(random));
    direction.normalize();
    double error[2], change[2];
    for (int i = 0; i < 2; ++i) {
      const double size = i == 0 ? 4e-3 : 2e-3;
      Disturbance d = before;
      d.acceleration_W.head<2>() += size * direction.head<2>();
      d.angular_acceleration_B[2] += size * direction[2];
      disturb(d);
      const Eigen::Vector4d u = problem_.input(solution(x0_).z, 0);
      error[i] = (feedback_.input() + feedback_.correction(x0_, problem_) - u).norm();
      change[i] = (u - problem_.input(plan.z, 0)).norm();
    }
    // What is left out of the sensitivity, of second order in the step, shows as a small linear part.
    EXPECT_LT(error[1], 0.35 * error[0] + 1e-2 * change[1]) << "trial " << trial;
    EXPECT_LT(error[1], 0.1 * change[1] + 1e-7) << "trial " << trial;
  }
}

}  // namespace
}  // namespace atmos
