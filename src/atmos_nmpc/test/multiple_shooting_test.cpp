#include "atmos_nmpc/multiple_shooting.h"

#include <gtest/gtest.h>

#include "atmos_nmpc/config.h"
#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/rate.h"
#include "numeric.h"

namespace atmos {
namespace {

using namespace state13;
using testing::attitudes;
using testing::moving_state;
using testing::numeric_jacobian;

Eigen::MatrixXd dense(const Sparsity& sparsity, const Eigen::VectorXd& values, int rows, int columns) {
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(rows, columns);
  for (int i = 0; i < sparsity.size(); ++i)
    M(sparsity.rows[static_cast<std::size_t>(i)], sparsity.columns[static_cast<std::size_t>(i)]) += values[i];
  return M;
}

class Shooting : public ::testing::TestWithParam<AttitudeError> {
 protected:
  Shooting() {
    config_.stages = 3;
    config_.attitude_error = GetParam();
  }
  // Everything in motion and out of its bounds, so that no term vanishes.
  Eigen::VectorXd point(const Quaternion4<double>& q) const {
    Eigen::VectorXd z(3 * 17);
    for (int k = 0; k < 3; ++k) {
      z.segment<4>(17 * k) << 0.3 * k, -0.5, 1.2, -1.0 + k;
      z.segment<13>(17 * k + 4) = moving_state(q, static_cast<std::uint32_t>(30 + k));
    }
    return z;
  }

  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  ControllerConfig config_ = load_controller(ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml", vehicle_);
};

// Gradient, Jacobian and Hessian of a problem at z against central differences.
template <class Problem>
void expect_exact_derivatives(const Problem& problem, const Eigen::VectorXd& z) {
  const int n = problem.variable_count(), m = problem.constraint_count();
  Eigen::VectorXd gradient(n);
  problem.gradient(z.data(), gradient.data());
  const Eigen::MatrixXd slope = numeric_jacobian(
      [&](const Eigen::VectorXd& at) { return Eigen::VectorXd::Constant(1, problem.objective(at.data())); },
      z);
  EXPECT_LT((gradient - slope.transpose()).norm(), 1e-6 * (1.0 + gradient.norm()));

  Eigen::VectorXd values(problem.jacobian_sparsity().size());
  problem.jacobian(z.data(), values.data());
  const Eigen::MatrixXd J = dense(problem.jacobian_sparsity(), values, m, n);
  const Eigen::MatrixXd expected_J = numeric_jacobian(
      [&](const Eigen::VectorXd& at) {
        Eigen::VectorXd g(m);
        problem.constraints(at.data(), g.data());
        return g;
      },
      z);
  EXPECT_LT((J - expected_J).cwiseAbs().maxCoeff(), 1e-8);

  const Eigen::VectorXd lambda = Eigen::VectorXd::LinSpaced(m, -1.0, 2.0);
  Eigen::VectorXd curvature(problem.hessian_sparsity().size());
  problem.hessian(z.data(), 0.6, lambda.data(), curvature.data());
  const Eigen::MatrixXd H = dense(problem.hessian_sparsity(), curvature, n, n);
  EXPECT_TRUE(H.isLowerTriangular());
  const Eigen::MatrixXd expected_H = numeric_jacobian(
      [&](const Eigen::VectorXd& at) {
        Eigen::VectorXd g(n), v(problem.jacobian_sparsity().size());
        problem.gradient(at.data(), g.data());
        problem.jacobian(at.data(), v.data());
        return Eigen::VectorXd(0.6 * g + dense(problem.jacobian_sparsity(), v, m, n).transpose() * lambda);
      },
      z, 1e-6);
  const Eigen::MatrixXd error = (H - expected_H).triangularView<Eigen::Lower>();
  EXPECT_LT(error.norm(), 1e-5 * (1.0 + H.norm()));
}

TEST_P(Shooting, DerivativesAgainstCentralDifferences) {
  for (const auto& [name, q] : attitudes(31)) {
    SCOPED_TRACE(name);
    DirectAllocation problem = make_direct_allocation(vehicle_, config_);
    State13<double> reference = moving_state(attitudes(32).back().second, 33);
    problem.cost().set_reference(reference, q, TrackingCost::PlanarWeight::Identity());
    problem.set_disturbance({{0.2, -0.1, 0.3}, {0.4, -0.5, 0.6}});
    problem.set_input_reference({0.3, -0.2, 0.1, -0.4});
    problem.set_initial_state(moving_state(q, 34));
    expect_exact_derivatives(problem, point(q));
  }
}

TEST_P(Shooting, DerivativesWithWallsAndAPolytopeOfInputs) {
  for (const auto& [name, q] : attitudes(31)) {
    SCOPED_TRACE(name);
    DirectAllocation problem = make_direct_allocation(vehicle_, config_);
    Places places;
    places.walls = {{{0.6, 0.8}, 0.1}, {{-1.0, 0.0}, 0.2}};
    problem.cost().set_places(places);
    Eigen::Matrix<double, Eigen::Dynamic, 4> normals(2, 4);
    normals << 0.5, 0.5, -0.5, 0.5, 0.1, -0.7, 0.7, 0.1;
    problem.set_input_polytope(normals, Eigen::Vector2d(0.4, -0.3), config_.bounds);
    problem.set_initial_state(moving_state(q, 34));
    expect_exact_derivatives(problem, point(q));
  }
}

// Every stage has a reference, an input reference and a disturbance of its own.
template <class Problem>
void make_stages_differ(Problem& problem, const Quaternion4<double>& q) {
  std::vector<State13<double>> references;
  for (std::uint32_t k = 0; k <= 3; ++k)
    references.push_back(moving_state(attitudes(40 + k).back().second, 50 + k));
  problem.cost().set_reference(references, q, TrackingCost::PlanarWeight::Identity());
  for (int k = 0; k < 3; ++k) {
    problem.set_disturbance(k, {{0.2 * k, -0.1, 0.3}, {0.4, -0.5 * k, 0.6}});
    problem.set_input_reference(k, Problem::Input::Constant(0.2 * k));
  }
}

TEST_P(Shooting, DerivativesWhereStagesDiffer) {
  for (const auto& [name, q] : attitudes(31)) {
    SCOPED_TRACE(name);
    DirectAllocation problem = make_direct_allocation(vehicle_, config_);
    make_stages_differ(problem, q);
    problem.set_initial_state(moving_state(q, 34));
    expect_exact_derivatives(problem, point(q));
  }
}

TEST_P(Shooting, DerivativesWithTheRateAsInput) {
  config_.formulation = FormulationKind::kRate;
  config_.force_n = 1.5;
  config_.rate_rad_s = 0.5;
  config_.rate_weight = 20.0;
  for (const auto& [name, q] : attitudes(31)) {
    SCOPED_TRACE(name);
    RateProblem problem = make_rate(vehicle_, config_);
    make_stages_differ(problem, q);
    problem.set_initial_state(moving_state(q, 34).head<10>());
    Eigen::VectorXd z(3 * 13);
    for (int k = 0; k < 3; ++k) {
      z.segment<3>(13 * k) << 0.3 * k, -0.5, 1.2;
      z.segment<10>(13 * k + 3) = moving_state(q, static_cast<std::uint32_t>(30 + k)).head<10>();
    }
    expect_exact_derivatives(problem, z);
  }
}

// The same motion by the 13-state: a body that turns with the rate asked for.
TEST(RateStep, MovesAsTheRigidBodyDoes) {
  const RateStep step(16.8, 0.1);
  const RigidBodyStep<2> body(Eigen::Matrix<double, 3, 2>::Identity(), Eigen::Matrix<double, 3, 2>::Zero(),
                              16.8, {0.1, 0.2, 0.3}, 0.1);
  for (const auto& [name, q] : attitudes(71)) {
    State13<double> x = moving_state(q, 72);
    x.tail<3>() << 0.0, 0.0, 0.4;
    const RateStep::State reached = step.next(x.head<10>(), {1.1, -0.7, 0.4});
    EXPECT_LT((reached - body.next(x, {1.1, -0.7}).head<10>()).norm(), 1e-12) << name;
  }
}
INSTANTIATE_TEST_SUITE_P(Errors, Shooting, ::testing::Values(AttitudeError::kVector, AttitudeError::kPaper));

using ShootingShift = Shooting;

TEST_P(ShootingShift, MovesEveryStageForwardAndHoldsTheLast) {
  const DirectAllocation problem = make_direct_allocation(vehicle_, config_);
  Iterate plan = problem.cold_start(1e-4);
  plan.z = point(attitudes(35).back().second);
  plan.lambda = Eigen::VectorXd::LinSpaced(problem.constraint_count(), 1.0, 2.0);
  plan.bound_lower = Eigen::VectorXd::LinSpaced(problem.variable_count(), 3.0, 4.0);
  const Iterate next = problem.shifted(plan);
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(problem.input(next.z, k), problem.input(plan.z, k + 1));
    EXPECT_EQ(problem.state(next.z, k + 1), problem.state(plan.z, k + 2));
    EXPECT_EQ(next.lambda.segment<13>(13 * k), plan.lambda.segment<13>(13 * (k + 1)));
    EXPECT_EQ(next.bound_lower.segment<17>(17 * k), plan.bound_lower.segment<17>(17 * (k + 1)));
  }
  EXPECT_EQ(problem.input(next.z, 2), problem.input(plan.z, 2));
  EXPECT_EQ(problem.state(next.z, 3),
            problem.dynamics().next(problem.state(plan.z, 3), problem.input(plan.z, 2)));
}
INSTANTIATE_TEST_SUITE_P(Shift, ShootingShift, ::testing::Values(AttitudeError::kVector));

}  // namespace
}  // namespace atmos
