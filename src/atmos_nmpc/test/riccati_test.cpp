#include "atmos_nmpc/riccati.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <random>
#include <stdexcept>

#include "atmos_nmpc/config.h"
#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/terminal_weight.h"

namespace atmos {
namespace {

using Eigen::MatrixXd;

MatrixXd gain_of(const MatrixXd& A, const MatrixXd& B, const MatrixXd& R, const MatrixXd& P) {
  return (R + B.transpose() * P * B).inverse() * B.transpose() * P * A;
}
double residual(const MatrixXd& A, const MatrixXd& B, const MatrixXd& Q, const MatrixXd& R,
                const MatrixXd& P) {
  return (A.transpose() * P * A - A.transpose() * P * B * gain_of(A, B, R, P) + Q - P).norm() / P.norm();
}

TEST(Riccati, ScalarClosedForm) {
  // p = p - p^2 / (1 + p) + 1 has the golden ratio as its positive root.
  const MatrixXd one = MatrixXd::Ones(1, 1);
  EXPECT_NEAR(solve_dare(one, one, one, one)(0, 0), 0.5 * (1.0 + std::sqrt(5.0)), 1e-12);
}

TEST(Riccati, ResidualVanishesAndTheLoopIsStable) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 50; ++trial) {
    const MatrixXd A = MatrixXd::NullaryExpr(6, 6, [&] { return normal(random); });
    const MatrixXd B = MatrixXd::NullaryExpr(6, 3, [&] { return normal(random); });
    const MatrixXd Q = MatrixXd::Identity(6, 6), R = 0.3 * MatrixXd::Identity(3, 3);
    const MatrixXd P = solve_dare(A, B, Q, R);
    EXPECT_LT(residual(A, B, Q, R, P), 1e-9) << "trial " << trial;
    EXPECT_LT((A - B * gain_of(A, B, R, P)).eigenvalues().cwiseAbs().maxCoeff(), 1.0) << "trial " << trial;
  }
}

TEST(Riccati, RefusesWhatCannotBeStabilised) {
  const MatrixXd A = 2.0 * MatrixXd::Identity(2, 2);
  const MatrixXd B = (MatrixXd(2, 1) << 1.0, 0.0).finished();
  EXPECT_THROW(solve_dare(A, B, MatrixXd::Identity(2, 2), MatrixXd::Identity(1, 1)), std::invalid_argument);
}

class TerminalWeight : public ::testing::Test {
 protected:
  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const ControllerConfig config_ =
      load_controller(ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml", vehicle_);
};

TEST_F(TerminalWeight, IsTheCostOfTheUnconstrainedInfiniteHorizon) {
  // Roll the linear regulator out on the non-linear model from a small error: its cost must be e' P e.
  const double yaw = 0.7;
  const DirectAllocation problem = make_direct_allocation(vehicle_, config_);
  const auto P = planar_terminal_weight(problem.dynamics(), config_.weights, problem.input_weight(), yaw);

  // Double-integrator model written down independently.
  const double h = config_.step_s;
  MatrixXd A = MatrixXd::Identity(6, 6), B = MatrixXd::Zero(6, 4);
  A.topRightCorner(3, 3).diagonal().setConstant(h);
  const AllocationMatrices pairs = pair_matrices(vehicle_, thruster_pairs(vehicle_));
  for (int j = 0; j < 4; ++j) {
    const double fx = pairs.D(0, j), fy = pairs.D(1, j);
    Eigen::Vector3d a((std::cos(yaw) * fx - std::sin(yaw) * fy) / vehicle_.mass_kg,
                      (std::sin(yaw) * fx + std::cos(yaw) * fy) / vehicle_.mass_kg,
                      pairs.L(2, j) / vehicle_.inertia_kg_m2[2]);
    B.col(j) << 0.5 * h * h * a, h * a;
  }
  Eigen::VectorXd q(6);
  const TrackingWeights& w = config_.weights;
  q << w.position[0], w.position[1], w.attitude[2], w.velocity[0], w.velocity[1], w.rate[2];
  const MatrixXd Q = q.asDiagonal(), R = config_.force_weight * MatrixXd::Identity(4, 4);
  EXPECT_LT(residual(A, B, Q, R, P), 1e-9);

  Eigen::VectorXd e(6);
  e << 0.1, -0.2, 0.3, 0.05, 0.1, -0.1;
  const double predicted = e.dot(P * e);
  const MatrixXd K = gain_of(A, B, R, P);
  double cost = 0.0;
  for (int k = 0; k < 5000; ++k) {
    const Eigen::VectorXd u = -K * e;
    cost += e.dot(Q * e) + u.dot(R * u);
    e = A * e + B * u;
  }
  EXPECT_NEAR(cost, predicted, 1e-9 * predicted);
}

}  // namespace
}  // namespace atmos
