#include "atmos_nmpc/tracking_cost.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "numeric.h"

namespace atmos {
namespace {

using namespace state13;
using testing::about_axis;
using testing::attitudes;
using testing::moving_state;
using testing::numeric_jacobian;

TrackingWeights weights() { return {{50, 40, 30}, {10, 9, 8}, {70, 60, 50}, {5, 4, 3}, 1.5}; }
SoftBounds bounds() { return {{1, 1, 1}, {0.5, 0.5, 0.5}, {1, 1, 1}, 100, 1000, 0.01}; }
SoftBounds no_bounds() { return {{1e6, 1e6, 1e6}, {1e6, 1e6, 1e6}, {1e6, 1e6, 1e6}, 0, 0, 0.01}; }

// Couples every planar direction with every other.
TrackingCost::PlanarWeight planar_weight() {
  const TrackingCost::PlanarWeight root =
      TrackingCost::PlanarWeight::NullaryExpr([](Eigen::Index i, Eigen::Index j) {
        return 3.0 * (i == j) + 0.3 * static_cast<double>(i) - 0.2 * static_cast<double>(j);
      });
  return root.transpose() * root;
}

State13<double> at_rest(const Quaternion4<double>& q) {
  State13<double> x = State13<double>::Zero();
  x.segment<4>(kQuaternion) = q;
  return x;
}

class BothErrors : public ::testing::TestWithParam<AttitudeError> {};

TEST_P(BothErrors, DerivativesAgainstCentralDifferences) {
  State13<double> reference = at_rest(about_axis({0, 0, 1}, 0.8));
  reference.head<3>() << 0.3, -0.2, 0.1;
  for (const auto& [name, q] : attitudes(21)) {
    const State13<double> x = moving_state(q, 22);
    TrackingCost cost(GetParam(), weights(), bounds());
    cost.set_reference(reference, q, planar_weight());
    for (const bool terminal : {false, true}) {
      State13<double> gradient = State13<double>::Zero();
      cost.add_gradient(x, 0, terminal, 0.7, gradient);
      const Eigen::MatrixXd slope = numeric_jacobian(
          [&](const Eigen::VectorXd& at) {
            return Eigen::VectorXd::Constant(1, 0.7 * cost.value(at, 0, terminal));
          },
          x);
      EXPECT_LT((gradient - slope.transpose()).norm(), 1e-6 * (1.0 + gradient.norm())) << name;

      TrackingCost::Hessian H = TrackingCost::Hessian::Zero();
      cost.add_hessian(x, 0, terminal, 0.7, H);
      const Eigen::MatrixXd curvature = numeric_jacobian(
          [&](const Eigen::VectorXd& at) {
            State13<double> g = State13<double>::Zero();
            cost.add_gradient(at, 0, terminal, 0.7, g);
            return Eigen::VectorXd(g);
          },
          x, 1e-6);
      const Eigen::MatrixXd lower = (H - curvature).triangularView<Eigen::Lower>();
      EXPECT_LT(lower.norm(), 1e-5 * (1.0 + H.norm())) << name;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Errors, BothErrors,
                         ::testing::Values(AttitudeError::kVector, AttitudeError::kPaper));

TEST(TrackingCost, DerivativesOfPlacesAgainstCentralDifferences) {
  TrackingCost cost(AttitudeError::kVector, weights(), bounds());
  Places places;
  places.walls = {{{0.6, 0.8}, 0.3}};
  places.obstacles = {{{0.2, 0.1}, 0.5, {0.05, 0.0}}};
  cost.set_places(places);
  State13<double> x = at_rest(about_axis({0, 0, 1}, 0.0));
  for (const int k : {0, 4}) {
    for (const double at : {-0.5, 0.15, 0.4}) {
      x.head<2>() << at, 0.3;
      State13<double> gradient = State13<double>::Zero();
      cost.add_gradient(x, k, false, 1.0, gradient);
      const Eigen::MatrixXd slope = numeric_jacobian(
          [&](const Eigen::VectorXd& y) { return Eigen::VectorXd::Constant(1, cost.value(y, k, false)); }, x);
      EXPECT_LT((gradient - slope.transpose()).norm(), 1e-5 * (1.0 + gradient.norm()));
      TrackingCost::Hessian H = TrackingCost::Hessian::Zero();
      cost.add_hessian(x, k, false, 1.0, H);
      const Eigen::MatrixXd curvature = numeric_jacobian(
          [&](const Eigen::VectorXd& y) {
            State13<double> g = State13<double>::Zero();
            cost.add_gradient(y, k, false, 1.0, g);
            return Eigen::VectorXd(g);
          },
          x, 1e-6);
      const Eigen::Matrix2d lower = (H - curvature).topLeftCorner<2, 2>().triangularView<Eigen::Lower>();
      EXPECT_LT(lower.norm(), 1e-5 * (1.0 + H.norm()));
    }
  }
  // An obstacle that moves away: at stage 4 its centre is at 0.4 m.
  x.head<2>() << -0.2, 0.1;
  EXPECT_GT(cost.value(x, 0, false) - cost.value(x, 4, false), 10.0);
}

TEST(TrackingCost, VectorErrorIsTheAngleAndBlindToTheQuaternionsSign) {
  for (const double yaw_ref : {0.0, 1.0, 3.0, -2.5}) {
    for (const double error : {1e-4, 0.5, -1.0}) {
      const Quaternion4<double> q = about_axis({0, 0, 1}, yaw_ref + error);
      for (const double sign : {1.0, -1.0}) {
        TrackingCost cost(AttitudeError::kVector, weights(), no_bounds());
        cost.set_reference(at_rest(about_axis({0, 0, 1}, yaw_ref)), sign * q, planar_weight());
        const double e = 2.0 * std::sin(0.5 * error);
        EXPECT_NEAR(cost.value(at_rest(sign * q), 0, false), 50.0 * e * e, 1e-9);
        // The coupling with the yaw rate has the sign of the shorter way.
        State13<double> x = at_rest(sign * q);
        x[kAngularVelocity + 2] = 0.1;
        Eigen::Matrix<double, 6, 1> planar;
        planar << 0, 0, e, 0, 0, 0.1;
        EXPECT_NEAR(cost.value(x, 0, true), planar.dot(planar_weight() * planar), 1e-9);
      }
    }
  }
}

TEST(TrackingCost, PaperErrorIsTheSquareOfOneMinusTheSquaredProduct) {
  TrackingCost cost(AttitudeError::kPaper, weights(), no_bounds());
  cost.set_reference(at_rest(about_axis({0, 0, 1}, 0.3)), about_axis({0, 0, 1}, 1.3), planar_weight());
  const double e = 1.0 - std::pow(std::cos(0.5), 2);
  EXPECT_NEAR(cost.value(at_rest(about_axis({0, 0, 1}, 1.3)), 0, false), 50.0 * e * e, 1e-12);
  EXPECT_NEAR(cost.value(at_rest(about_axis({0, 0, 1}, 1.3)), 0, true), 1.5 * 50.0 * e * e, 1e-12);
}

TEST(TrackingCost, SoftBoundsCostNothingInsideAndTheirPenaltyOutside) {
  const Quaternion4<double> q = about_axis({0, 0, 1}, 0.0);
  const TrackingCost with(AttitudeError::kVector, weights(), bounds());
  const TrackingCost without(AttitudeError::kVector, weights(), no_bounds());
  State13<double> x = at_rest(q);
  EXPECT_NEAR(with.value(x, 0, false) - without.value(x, 0, false), 0.0, 0.1);
  x[kVelocity] = -0.7;
  EXPECT_NEAR(with.value(x, 0, false) - without.value(x, 0, false), 100 * 0.2 + 1000 * 0.04, 0.2);
  EXPECT_EQ(with.active_bounds(x, 0), 1);
}

}  // namespace
}  // namespace atmos
