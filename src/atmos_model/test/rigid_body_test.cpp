#include "atmos_model/rigid_body.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

namespace atmos {
namespace {

using namespace state13;
using State = State13<double>;
using V3 = Vec3<double>;

const Eigen::Vector3d kInertia(0.2, 0.3, 0.45);

State at_rest() {
  State x = State::Zero();
  x[kQuaternion] = 1.0;
  return x;
}

State fly(State x, const V3& force_B, const V3& torque_B, double duration, int steps) {
  const double dt = duration / steps;
  for (int k = 0; k < steps; ++k)
    x = rk4_step(
        x, dt, [&](const State& s) { return rigid_body_rate<double>(s, force_B, torque_B, 16.8, kInertia); });
  return x;
}

TEST(RigidBody, RotatesAsHamiltonQuaternionsBodyToWorld) {
  const double s = std::sqrt(0.5);
  const V3 v(1.0, 2.0, 3.0);
  EXPECT_TRUE(rotate<double>({s, 0, 0, s}, v).isApprox(V3(-2.0, 1.0, 3.0), 1e-14));  // 90 degrees about z
  EXPECT_TRUE(rotate<double>({s, s, 0, 0}, v).isApprox(V3(1.0, -3.0, 2.0), 1e-14));  // about x
  EXPECT_TRUE(rotate<double>({s, 0, s, 0}, v).isApprox(V3(3.0, 2.0, -1.0), 1e-14));  // about y
  const Eigen::Quaterniond q = Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized();
  EXPECT_TRUE(rotate<double>({q.w(), q.x(), q.y(), q.z()}, v).isApprox(q * v, 1e-14));
}

TEST(RigidBody, FreeFlightHasAClosedForm) {
  State x = at_rest();
  x.segment<3>(kPosition) << 1.0, -2.0, 0.5;
  x.segment<3>(kVelocity) << 0.2, 0.1, -0.3;
  const State coasted = fly(x, V3::Zero(), V3::Zero(), 10.0, 100);
  EXPECT_TRUE(coasted.segment<3>(kPosition).isApprox(V3(3.0, -1.0, -2.5), 1e-12));
  // Constant force in the attitude that turns body x to world y.
  x.segment<4>(kQuaternion) << std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5);
  const State pushed = fly(x, V3(1.68, 0, 0), V3::Zero(), 10.0, 100);
  EXPECT_TRUE(pushed.segment<3>(kPosition).isApprox(V3(3.0, -1.0 + 0.5 * 0.1 * 100.0, -2.5), 1e-12));
  EXPECT_TRUE(pushed.segment<3>(kVelocity).isApprox(V3(0.2, 1.1, -0.3), 1e-12));
  // Constant yaw torque: angle 1/2 alpha t^2, sense by the right hand.
  const State turned = fly(at_rest(), V3::Zero(), V3(0, 0, 0.045), 4.0, 400);
  EXPECT_NEAR(turned[kAngularVelocity + 2], 0.4, 1e-12);
  EXPECT_NEAR(2.0 * std::atan2(turned[kQuaternion + 3], turned[kQuaternion]), 0.8, 1e-9);
}

TEST(RigidBody, TorqueFreeTumblingKeepsEnergyAndAngularMomentum) {
  State x = at_rest();
  x.segment<3>(kAngularVelocity) << 0.1, 2.0, 0.2;  // about the unstable middle axis
  const auto energy = [](const State& s) {
    return 0.5 * s.segment<3>(kAngularVelocity).cwiseAbs2().dot(kInertia);
  };
  const auto momentum_W = [](const State& s) {
    return rotate<double>(s.segment<4>(kQuaternion),
                          kInertia.cwiseProduct(V3(s.segment<3>(kAngularVelocity))));
  };
  const State after = fly(x, V3::Zero(), V3::Zero(), 20.0, 20000);
  EXPECT_NEAR(energy(after), energy(x), 1e-9);
  EXPECT_LT((momentum_W(after) - momentum_W(x)).norm(), 1e-9);
  EXPECT_NEAR(after.segment<4>(kQuaternion).norm(), 1.0, 1e-9);
  EXPECT_GT((after - x).segment<3>(kAngularVelocity).norm(), 0.1);
}

TEST(RigidBody, EulersEquationHasTheMinusSign) {
  State x = at_rest();
  x.segment<3>(kAngularVelocity) << 1.0, 2.0, 3.0;
  const State rate = rigid_body_rate<double>(x, V3::Zero(), V3::Zero(), 16.8, kInertia);
  const V3 w(1.0, 2.0, 3.0);
  const V3 expected = (-w.cross(kInertia.cwiseProduct(w))).cwiseQuotient(kInertia);
  EXPECT_TRUE(rate.segment<3>(kAngularVelocity).isApprox(expected, 1e-14));
  EXPECT_TRUE(rate.segment<4>(kQuaternion).isApprox(Eigen::Vector4d(0.0, 0.5, 1.0, 1.5), 1e-14));
}

TEST(RigidBody, RungeKuttaIsOfOrderFour) {
  State x = at_rest();
  x.segment<3>(kAngularVelocity) << 0.5, -0.7, 1.1;
  const V3 force(1.0, -2.0, 0.5), torque(0.02, 0.05, -0.03);
  const State fine = fly(x, force, torque, 2.0, 4000);
  const double coarse_error = (fly(x, force, torque, 2.0, 20) - fine).norm();
  const double half_error = (fly(x, force, torque, 2.0, 40) - fine).norm();
  EXPECT_NEAR(std::log2(coarse_error / half_error), 4.0, 0.2);
}

TEST(RigidBody, IsTemplatedOnTheScalar) {
  State x = at_rest();
  x.segment<3>(kAngularVelocity) << 0.5, -0.7, 1.1;
  const State13<long double> wide = rigid_body_rate<long double>(
      x.cast<long double>(), Vec3<long double>(1, 2, 3), Vec3<long double>(4, 5, 6), 16.8L, kInertia);
  EXPECT_TRUE(
      wide.cast<double>().isApprox(rigid_body_rate<double>(x, V3(1, 2, 3), V3(4, 5, 6), 16.8, kInertia)));
}

}  // namespace
}  // namespace atmos
