#include "atmos_nmpc/trajectory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace atmos {
namespace {

constexpr double kStart = 1234.5;

// A circle of 1 m in 10 s that turns with its tangent.
TrajectoryPoint on_circle(double t) {
  const double n = 2.0 * M_PI / 10.0, c = std::cos(n * t), s = std::sin(n * t);
  return {kStart + t,         {c, s, 0}, {std::cos(0.5 * n * t), 0, 0, std::sin(0.5 * n * t)},
          {-n * s, n * c, 0}, {0, 0, n}, {-n * n * c, -n * n * s, 0}};
}
std::vector<TrajectoryPoint> circle() {
  std::vector<TrajectoryPoint> points;
  for (int k = 0; k <= 100; ++k) points.push_back(on_circle(0.1 * k));
  return points;
}

TEST(Trajectory, FollowsTheCurveBetweenItsPoints) {
  const Trajectory trajectory(circle());
  for (double t = 0.037; t < 10.0; t += 0.271) {
    const ReferencePoint point = trajectory.at(kStart + t);
    const TrajectoryPoint exact = on_circle(t);
    EXPECT_LT((point.x.segment<3>(state13::kPosition) - exact.p_WB).norm(), 1e-6);
    EXPECT_LT((point.x.segment<3>(state13::kVelocity) - exact.v_WB).norm(), 1e-4);
    EXPECT_LT((point.motion.acceleration_W - exact.a_WB).norm(), 1e-3);
    EXPECT_NEAR(std::abs(point.x.segment<4>(state13::kQuaternion).dot(exact.q_WB)), 1.0, 1e-12);
    EXPECT_LT((point.motion.rate_B - exact.w_WB_W).norm(), 1e-9);
    EXPECT_LT(point.motion.angular_acceleration_B.norm(), 1e-9);
  }
}

TEST(Trajectory, RestsBeforeItsStartAndAfterItsEnd) {
  const Trajectory trajectory(circle());
  const ReferencePoint before = trajectory.at(kStart - 3.0), after = trajectory.at(kStart + 12.0);
  EXPECT_EQ(before, at_rest({1, 0, 0}, {1, 0, 0, 0}));
  EXPECT_LT((after.x.head<3>() - Vec3<double>(1, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(after.x.segment<3>(state13::kVelocity).norm(), 0.0);
  EXPECT_EQ(after.motion.acceleration_W.norm(), 0.0);
}

TEST(Trajectory, EachBrokenRuleIsNamed) {
  EXPECT_EQ(trajectory_fault(circle()), "");
  EXPECT_NE(trajectory_fault({on_circle(0)}), "");
  for (int fault = 0; fault < 5; ++fault) {
    std::vector<TrajectoryPoint> points = circle();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    if (fault == 0) points[7].time_s = points[6].time_s;
    if (fault == 1) points[7].p_WB[1] = nan;
    if (fault == 2) points[7].q_WB *= 0.0;
    if (fault == 3) points[7].v_WB[0] = std::numeric_limits<double>::infinity();
    if (fault == 4) points[7].a_WB[2] = nan;
    EXPECT_NE(trajectory_fault(points).find("point 7"), std::string::npos) << fault;
  }
}

}  // namespace
}  // namespace atmos
