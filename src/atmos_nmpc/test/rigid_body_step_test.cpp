#include "atmos_nmpc/rigid_body_step.h"

#include <gtest/gtest.h>

#include "numeric.h"

namespace atmos {
namespace {

using namespace state13;
using testing::attitudes;
using testing::moving_state;
using testing::numeric_jacobian;

// Four inputs in general position, so that no term of the derivatives is zero by symmetry.
class RigidBodyStepTest : public ::testing::Test {
 protected:
  Eigen::Matrix<double, 3, 4> D_ =
      (Eigen::Matrix<double, 3, 4>() << 1, 0.2, -0.3, 0, 0.1, 1, 0, -0.8, 0.4, 0, 1, 0.5).finished();
  Eigen::Matrix<double, 3, 4> L_ =
      (Eigen::Matrix<double, 3, 4>() << 0.1, 0, -0.2, 0.3, 0, 0.12, 0.1, -0.1, -0.12, 0.12, 0, 0.2)
          .finished();
  Eigen::Vector3d inertia_{0.2, 0.31, 0.45};
  double mass_ = 3.0, step_s_ = 0.1;
  RigidBodyStep<4> step_{D_, L_, mass_, inertia_, step_s_};
  Eigen::Vector4d u_{1.1, -0.7, 0.4, 1.5};

  // (q, w, u) in place of those of x and u_.
  State13<double> next_of(const State13<double>& x, const Eigen::VectorXd& free) const {
    State13<double> at = x;
    at.segment<7>(kQuaternion) = free.head<7>();
    return step_.next(at, free.tail<4>());
  }
  Eigen::VectorXd free_of(const State13<double>& x) const {
    Eigen::VectorXd free(11);
    free << x.segment<7>(kQuaternion), u_;
    return free;
  }
};

TEST_F(RigidBodyStepTest, IsTheModelsRungeKuttaStep) {
  for (const auto& [name, q] : attitudes(1)) {
    const State13<double> x = moving_state(q, 2);
    const State13<double> expected = rk4_step(x, step_s_, [&](const State13<double>& at) {
      return rigid_body_rate<double>(at, D_ * u_, L_ * u_, mass_, inertia_);
    });
    EXPECT_LT((step_.next(x, u_) - expected).norm(), 1e-13) << name;
  }
}

TEST_F(RigidBodyStepTest, JacobianAgainstCentralDifferences) {
  for (const auto& [name, q] : attitudes(3)) {
    const State13<double> x = moving_state(q, 4);
    RigidBodyStep<4>::Jacobian J;
    step_.jacobian(x, u_, J);
    const Eigen::MatrixXd expected = numeric_jacobian(
        [&](const Eigen::VectorXd& free) { return Eigen::VectorXd(next_of(x, free)); }, free_of(x));
    EXPECT_LT((J - expected).cwiseAbs().maxCoeff(), 1e-9) << name;
  }
}

TEST_F(RigidBodyStepTest, IsLinearInPositionAndVelocityAsDeclared) {
  const State13<double> x = moving_state(attitudes(5).back().second, 6);
  const Eigen::MatrixXd J = numeric_jacobian(
      [&](const Eigen::VectorXd& pv) {
        State13<double> at = x;
        at.head<6>() = pv;
        return Eigen::VectorXd(step_.next(at, u_));
      },
      x.head<6>());
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(13, 6);
  expected.topRows(6).setIdentity();
  expected.block(0, 3, 3, 3).diagonal().setConstant(step_s_);
  EXPECT_LT((J - expected).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_F(RigidBodyStepTest, HessianAgainstCentralDifferencesOfTheJacobian) {
  for (const auto& [name, q] : attitudes(7)) {
    const State13<double> x = moving_state(q, 8);
    const State13<double> lambda = moving_state(attitudes(9).back().second, 10);
    RigidBodyStep<4>::Hessian H;
    step_.hessian(x, u_, lambda, H);
    const Eigen::MatrixXd expected = numeric_jacobian(
        [&](const Eigen::VectorXd& free) {
          State13<double> at = x;
          at.segment<7>(kQuaternion) = free.head<7>();
          RigidBodyStep<4>::Jacobian J;
          step_.jacobian(at, free.tail<4>(), J);
          return Eigen::VectorXd(J.transpose() * lambda);
        },
        free_of(x));
    EXPECT_LT((H - expected).cwiseAbs().maxCoeff(), 1e-8) << name;
  }
}

TEST_F(RigidBodyStepTest, DisturbanceJacobianAgainstCentralDifferences) {
  for (const auto& [name, q] : attitudes(11)) {
    const State13<double> x = moving_state(q, 12);
    const Eigen::MatrixXd expected = numeric_jacobian(
        [&](const Eigen::VectorXd& d) {
          step_.set_disturbance({d.head<3>(), d.tail<3>()});
          return Eigen::VectorXd(step_.next(x, u_));
        },
        Eigen::VectorXd::LinSpaced(6, -0.3, 0.4));
    step_.set_disturbance({Eigen::Vector3d::LinSpaced(-0.3, -0.02), Eigen::Vector3d::LinSpaced(0.12, 0.4)});
    EXPECT_LT((step_.disturbance_jacobian(x, u_) - expected).cwiseAbs().maxCoeff(), 1e-9) << name;
  }
}

}  // namespace
}  // namespace atmos
