#include "atmos_operator/distance_monitor.h"

#include <gtest/gtest.h>

#include <cmath>

namespace atmos {
namespace {

constexpr double kStart = 1234.5;
const BrakingAbility kAbility = {0.2, 0.2, 2.0};
const DistanceMonitorSettings kSettings = {0.05, 0.2, 0.5, 0.5, 0.5};

SeenMotion motion(double t, double x, double y, double vx, double vy, double yaw_rate = 0.0) {
  return {kStart + t, {x, y}, {vx, vy}, 0.3, yaw_rate};
}

DistanceMonitor two() { return DistanceMonitor({{"snap", kAbility}, {"crackle", kAbility}}, kSettings); }

TEST(BrakingAbility, IsThatOfTheWeakestDirection) {
  const Vehicle vehicle = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const BrakingAbility ability = braking_ability(vehicle);
  // Two thrusters along each axis; across, more.
  EXPECT_NEAR(ability.acceleration_m_s2, 2.0 * 1.7 / 16.8, 1e-9);
  EXPECT_NEAR(ability.yaw_acceleration_rad_s2, 4.0 * 1.7 * 0.12 / 0.297, 1e-9);
  EXPECT_EQ(ability.radius_m, vehicle.radius_m);
}

TEST(BrakingPath, ComesToRestAsTheEquationsSay) {
  const BrakingPath path(motion(0.0, 1.0, 2.0, 0.3, -0.4, 0.5), kAbility, kSettings);
  EXPECT_NEAR(path.end_s() - kStart, 0.1 + 5.0, 1e-9);
  const BrakingPoint end = path.at(path.end_s() + 1.0);
  const double way = 0.5 * 0.1 + 0.5 * 0.5 / 0.2;  // v t + v^2 / 2a
  EXPECT_NEAR((end.p_W - Eigen::Vector2d(1.0, 2.0)).norm(), way, 1e-9);
  EXPECT_NEAR(end.p_W.x() - 1.0, 0.6 * way, 1e-9);
  EXPECT_EQ(end.v_W.norm(), 0.0);
  EXPECT_NEAR(end.yaw, 0.3 + 0.5 * 0.1 + 0.25 / 2.0, 1e-9);
  // Positions, velocities and accelerations belong together.
  for (double t = 0.05; t < 5.0; t += 0.37) {
    const double h = 1e-5;
    const BrakingPoint a = path.at(kStart + t - h), b = path.at(kStart + t), c = path.at(kStart + t + h);
    EXPECT_LT(((c.p_W - a.p_W) / (2.0 * h) - b.v_W).norm(), 1e-5) << t;
    EXPECT_LT(((c.v_W - a.v_W) / (2.0 * h) - b.a_W).norm(), 1e-5) << t;
    EXPECT_NEAR((c.yaw - a.yaw) / (2.0 * h), b.yaw_rate, 1e-5) << t;
  }
}

TEST(BrakingPath, AsAReferenceItIsNeverOver) {
  const BrakingPath path(motion(0.0, 1.0, 2.0, 0.3, 0.0), kAbility, kSettings);
  for (const double from : {-5.0, 0.0, 1.0, 500.0}) {
    const auto points = path.points_from(kStart + from);
    ASSERT_GE(points.size(), 2u);
    EXPECT_NEAR(points.front().time_s, kStart + std::max(0.0, from), from > 5.0 ? 0.11 : 1e-9);
    for (std::size_t i = 1; i < points.size(); ++i) EXPECT_GT(points[i].time_s, points[i - 1].time_s);
    EXPECT_GT(points.back().time_s, kStart + from + 5000.0);
    EXPECT_EQ(points.back().v_W.norm(), 0.0);
  }
}

// The stop comes as late as braking allows, and leaves the margin.
TEST(DistanceMonitor, StopsRobotsThatMeetHeadOn) {
  DistanceMonitor monitor = two();
  const double speed = 0.2;
  const double most = speed + 0.2 * kSettings.reaction_s;  // that it may have when it brakes
  const double need =                                      // between the centres
      2.0 * (most * kSettings.reaction_s + most * most / 0.2) + 0.4 + kSettings.margin_m;
  double t = 0.0;
  for (; t < 20.0; t += 0.01) {
    const auto a = monitor.see(0, motion(t, -2.0 + speed * t, 0.0, speed, 0.0));
    const auto b = monitor.see(1, motion(t, 2.0 - speed * t, 0.0, -speed, 0.0));
    if (!a.empty() || !b.empty()) break;
  }
  EXPECT_NEAR(4.0 - 2.0 * speed * t, need, 0.01);
  EXPECT_TRUE(monitor.held(0) && monitor.held(1));
  EXPECT_NE(monitor.reason().find("snap"), std::string::npos);
  // Both at rest at the ends of their paths.
  const double apart = (monitor.path(0).at(1e6).p_W - monitor.path(1).at(1e6).p_W).norm();
  EXPECT_GE(apart, 0.4 + kSettings.margin_m);
}

TEST(DistanceMonitor, LetsPassWhatPasses) {
  DistanceMonitor monitor = two();
  for (double t = 0.0; t < 20.0; t += 0.01) {
    EXPECT_TRUE(monitor.see(0, motion(t, -2.0 + 0.2 * t, 0.0, 0.2, 0.0)).empty());
    EXPECT_TRUE(monitor.see(1, motion(t, 2.0 - 0.2 * t, 0.5, -0.2, 0.0)).empty()) << t;
  }
  EXPECT_NEAR(monitor.distance_m(0), std::hypot(4.0, 0.5) - 0.4, 0.01);
}

TEST(DistanceMonitor, AMovingRobotIsStoppedBeforeOneThatStands) {
  DistanceMonitor monitor = two();
  std::vector<std::size_t> stopped;
  for (double t = 0.0; t < 20.0 && stopped.empty(); t += 0.01) {
    stopped = monitor.see(0, motion(t, -2.0 + 0.2 * t, 0.1, 0.2, 0.0));
    if (stopped.empty()) stopped = monitor.see(1, motion(t, 0.0, 0.0, 0.0, 0.0));
  }
  EXPECT_EQ(stopped.size(), 2u);
  EXPECT_GE(monitor.path(0).at(1e6).p_W.norm(), 0.4 + kSettings.margin_m);
}

TEST(DistanceMonitor, RobotsThatBeginCloseMayPartButNotApproach) {
  DistanceMonitor monitor = two();
  EXPECT_TRUE(monitor.see(0, motion(0.0, 0.0, 0.0, 0.0, 0.0)).empty());
  EXPECT_TRUE(monitor.see(1, motion(0.0, 0.43, 0.0, 0.003, 0.0)).empty()) << "noise of standing robots";
  EXPECT_TRUE(monitor.see(1, motion(0.1, 0.43, 0.0, 0.1, 0.0)).empty()) << "parting";
  EXPECT_EQ(monitor.see(1, motion(0.2, 0.43, 0.0, -0.05, 0.0)).size(), 2u);
}

TEST(DistanceMonitor, ReleasedTheyMayPartButNotApproach) {
  DistanceMonitor monitor = two();
  monitor.see(0, motion(0.0, 0.0, 0.0, 0.2, 0.0));
  ASSERT_EQ(monitor.see(1, motion(0.0, 0.6, 0.0, -0.2, 0.0)).size(), 2u);
  // By the time of the release they stand.
  monitor.see(0, motion(0.05, 0.0, 0.0, 0.0, 0.0));
  monitor.see(1, motion(0.05, 0.42, 0.0, 0.0, 0.0));
  monitor.release();
  EXPECT_FALSE(monitor.held(0) || monitor.held(1));
  EXPECT_EQ(monitor.reason(), "");
  EXPECT_TRUE(monitor.see(0, motion(0.1, 0.0, 0.0, 0.0, 0.0)).empty());
  EXPECT_TRUE(monitor.see(1, motion(0.1, 0.42, 0.0, 0.0, 0.0)).empty());
  EXPECT_TRUE(monitor.see(1, motion(0.2, 0.42, 0.0, 0.1, 0.0)).empty());
  EXPECT_EQ(monitor.see(1, motion(0.3, 0.42, 0.0, -0.1, 0.0)).size(), 2u);
}

TEST(DistanceMonitor, WhereItComesToRestItStays) {
  DistanceMonitor monitor = two();
  monitor.see(0, motion(0.0, 0.0, 0.0, 0.2, 0.0));
  ASSERT_EQ(monitor.see(1, motion(0.0, 0.8, 0.0, -0.2, 0.0)).size(), 2u);
  // Its controller brakes worse than asked: it rests beyond the end of its path.
  const double end = monitor.path(0).at(1e6).p_W.x();
  EXPECT_TRUE(monitor.see(0, motion(1.0, 0.2, 0.0, 0.1, 0.0)).empty());
  EXPECT_EQ(monitor.see(0, motion(3.0, end + 0.1, 0.0, 0.01, 0.0)).front(), 0u);
  EXPECT_NEAR(monitor.path(0).at(1e6).p_W.x(), end + 0.1, 0.01);
  EXPECT_TRUE(monitor.held(0));
  for (const std::size_t told : monitor.see(0, motion(3.1, end + 0.1, 0.0, 0.0, 0.0)))
    EXPECT_NE(told, 0u) << "again";
}

TEST(DistanceMonitor, ARobotThatIsNotSeenStopsAllOthers) {
  DistanceMonitor monitor = two();
  monitor.see(0, motion(0.0, 0.0, 0.0, 0.0, 0.0));
  monitor.see(1, motion(0.0, 5.0, 0.0, 0.1, 0.0));
  EXPECT_TRUE(monitor.see(1, motion(0.49, 5.0, 0.0, 0.1, 0.0)).empty());
  EXPECT_EQ(monitor.see(1, motion(0.52, 5.0, 0.0, 0.1, 0.0)), std::vector<std::size_t>{1});
  EXPECT_EQ(monitor.reason(), "snap is not seen");
  EXPECT_FALSE(monitor.held(0)) << "its controller has closed its valves";
  EXPECT_EQ(monitor.distance_m(1), std::numeric_limits<double>::infinity());
  // Seen again and released, they fly.
  monitor.see(0, motion(0.6, 0.0, 0.0, 0.0, 0.0));
  monitor.release();
  EXPECT_TRUE(monitor.see(1, motion(0.61, 5.0, 0.0, 0.1, 0.0)).empty());
}

TEST(DistanceMonitor, ARobotThatNeverCameCountsAsNotSeen) {
  DistanceMonitor monitor = two();
  EXPECT_TRUE(monitor.see(1, motion(0.0, 5.0, 0.0, 0.1, 0.0)).empty()) << "the other may be a frame later";
  EXPECT_EQ(monitor.see(1, motion(0.6, 5.0, 0.0, 0.1, 0.0)).size(), 1u);
}

TEST(DistanceMonitor, BadMotionsAreIgnored) {
  DistanceMonitor monitor = two();
  monitor.see(0, motion(1.0, 0.0, 0.0, 0.2, 0.0));
  EXPECT_TRUE(monitor.see(0, motion(0.5, 9.0, 0.0, 0.2, 0.0)).empty());
  EXPECT_TRUE(monitor.see(0, motion(1.1, std::nan(""), 0.0, 0.2, 0.0)).empty());
  EXPECT_TRUE(monitor.see(0, motion(std::nan(""), 0.0, 0.0, 0.2, 0.0)).empty());
  EXPECT_EQ(monitor.see(1, motion(1.0, 0.6, 0.0, -0.2, 0.0)).size(), 2u) << "judged by what was good";
}

}  // namespace
}  // namespace atmos
