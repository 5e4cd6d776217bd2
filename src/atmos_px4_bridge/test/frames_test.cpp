#include "atmos_px4_bridge/frames.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

TEST(Frames, KnownAnswers) {
  EXPECT_EQ(swap_world({1, 2, 3}), Vector3d(2, 1, -3));
  EXPECT_EQ(swap_body({1, 2, 3}), Vector3d(1, -2, -3));
  EXPECT_NEAR(swap_yaw(0.0), M_PI_2, 1e-15);         // facing east
  EXPECT_NEAR(swap_yaw(M_PI_2), 0.0, 1e-15);         // facing north
  EXPECT_NEAR(swap_yaw(M_PI_2 + 0.1), -0.1, 1e-12);  // a turn to the left is one against the compass
}

TEST(Frames, EveryConversionIsItsOwnInverse) {
  const Quaterniond q = Quaterniond(0.4, -0.3, 0.6, 0.2).normalized();
  EXPECT_NEAR(std::abs(swap_attitude(swap_attitude(q)).dot(q)), 1.0, 1e-12);
  EXPECT_EQ(swap_world(swap_world({1, 2, 3})), Vector3d(1, 2, 3));
  EXPECT_NEAR(swap_yaw(swap_yaw(2.5)), 2.5, 1e-12);
}

// A body vector seen in the world is the same whether it is converted before or after the rotation.
TEST(Frames, AttitudeFitsTheVectors) {
  const Quaterniond q = Quaterniond(0.4, -0.3, 0.6, 0.2).normalized();
  const Vector3d v(0.7, -1.1, 0.4);
  EXPECT_NEAR((swap_attitude(q) * swap_body(v) - swap_world(q * v)).norm(), 0.0, 1e-12);
  const double yaw = 0.8;
  const Quaterniond turned(Eigen::AngleAxisd(yaw, Vector3d::UnitZ()));
  const Quaterniond expected(Eigen::AngleAxisd(swap_yaw(yaw), Vector3d::UnitZ()));
  EXPECT_NEAR(std::abs(swap_attitude(turned).dot(expected)), 1.0, 1e-12);
}

TEST(Frames, CovariancesTurnWithTheirVectors) {
  Matrix6d m = Matrix6d::Zero();
  m.diagonal() << 1, 2, 3, 4, 5, 6;
  m(0, 2) = m(2, 0) = 0.5;
  m(1, 3) = m(3, 1) = 0.25;
  const Matrix6d world = swap_world_covariance(m);
  EXPECT_EQ(world(0, 0), 2.0);  // north is our y
  EXPECT_EQ(world(1, 1), 1.0);
  EXPECT_EQ(world(1, 2), -0.5);
  EXPECT_EQ(world(0, 4), 0.25);
  EXPECT_EQ(world(3, 3), 5.0);
  const Matrix6d body = swap_body_covariance(m);
  EXPECT_EQ(body(0, 2), -0.5);
  EXPECT_EQ(body(1, 3), -0.25);
  EXPECT_EQ(body(5, 5), 6.0);
}

}  // namespace
}  // namespace atmos
