#include "atmos_operator/mission.h"

#include <gtest/gtest.h>

#include <map>

namespace atmos {
namespace {

constexpr double kStart = 1234.5;

TrajectorySettings circle(double time_s) {
  TrajectorySettings settings{};
  settings.time_s = time_s;
  settings.duration_s = 20.0;
  settings.shape = TrajectorySettings::Shape::kCircle;
  settings.size_x_m = settings.size_y_m = 0.5;
  settings.laps = 1.0;
  return settings;
}

MissionProgram points() { return {{{0.0, 0.0, 0.0, 0.0}, {20.0, 1.0, 0.0, 0.5}, {40.0, 1.0, 1.0, 1.5}}, {}}; }

// What a listener makes of it: of equal stamps the later message counts.
class Listener {
 public:
  void hear(const MissionOrders& orders) {
    for (const auto& point : orders.points) held_[point.stamp] = point.x_m;
    for (const auto& curve : orders.trajectories) held_[curve.stamp()] = kCurve;
  }
  double at(double now) const { return std::prev(held_.upper_bound(now))->second; }

  static constexpr double kCurve = 99.0;

 private:
  std::map<double, double> held_;
};

TEST(Mission, WaitsUntilItIsStarted) {
  Mission mission(points());
  EXPECT_EQ(mission.state(kStart), MissionState::kIdle);
  EXPECT_TRUE(mission.due(kStart + 30.0).points.empty());
  EXPECT_TRUE(mission.stop(kStart, {}).points.empty());
  mission.start(kStart + 30.0);
  EXPECT_EQ(mission.state(kStart + 30.0), MissionState::kRunning);
  EXPECT_EQ(mission.in_force(kStart + 50.5)->x_m, 1.0);
  EXPECT_EQ(mission.state(kStart + 70.0), MissionState::kFinished);
}

TEST(Mission, StoppedItHoldsItsPlaceWhateverWasAnnounced) {
  Mission mission(points());
  Listener robot;
  robot.hear(mission.start(kStart));
  robot.hear(mission.stop(kStart + 5.0, {0.0, 0.3, 0.0, 0.0}));
  EXPECT_EQ(mission.state(kStart + 5.0), MissionState::kStopped);
  for (double t = 5.0; t < 60.0; t += 0.5) {
    robot.hear(mission.due(kStart + t));
    EXPECT_EQ(robot.at(kStart + t), 0.3) << t;
  }
  EXPECT_EQ(mission.announced(kStart + 50.0).points.size(), 1u);
}

TEST(Mission, StartsAnewWhateverIsLeftOfEarlierRuns) {
  Mission mission(points());
  Listener robot;
  robot.hear(mission.start(kStart));
  robot.hear(mission.stop(kStart + 5.0, {0.0, 0.3, 0.0, 0.0}));
  robot.hear(mission.start(kStart + 10.0));
  robot.hear(mission.start(kStart + 18.0));
  for (double t = 18.0; t < 90.0; t += 0.5) {
    robot.hear(mission.due(kStart + t));
    EXPECT_EQ(robot.at(kStart + t), t < 38.0 ? 0.0 : 1.0) << t;
  }
}

TEST(Mission, TrajectoriesAreStoppedAndTakenUpAgain) {
  MissionProgram program = points();
  program.set_points.resize(1);
  program.trajectories = {circle(10.0), circle(60.0)};
  Mission mission(program);
  Listener robot;
  robot.hear(mission.start(kStart));
  EXPECT_EQ(robot.at(kStart + 15.0), Listener::kCurve);
  robot.hear(mission.stop(kStart + 5.0, {0.0, 0.3, 0.0, 0.0}));
  EXPECT_EQ(robot.at(kStart + 15.0), 0.3);
  EXPECT_EQ(robot.at(kStart + 65.0), 0.3);
  // What the first run had at 10 s and 60 s falls before and after the first curve of the second run.
  robot.hear(mission.start(kStart + 8.0));
  EXPECT_EQ(robot.at(kStart + 11.0), 0.0);
  EXPECT_EQ(robot.at(kStart + 19.0), Listener::kCurve);
  EXPECT_EQ(robot.at(kStart + 61.0), 0.5) << "rests where the circle ended";
  // And here within it.
  robot.hear(mission.start(kStart + 45.0));
  EXPECT_EQ(robot.at(kStart + 65.0), Listener::kCurve);
  EXPECT_EQ(mission.announced(kStart + 45.0).trajectories.size(), 2u);
}

TEST(Mission, ATrajectoryIsCutAtTheInstantItTakesOver) {
  MissionProgram program = points();
  program.set_points.resize(1);
  program.trajectories = {circle(10.0), circle(40.0)};
  Mission mission(program);
  mission.start(kStart);
  const auto orders = mission.start(kStart + 25.0);
  ASSERT_EQ(orders.trajectories.size(), 3u);
  EXPECT_EQ(orders.trajectories[2].from_s, 5.0);
  EXPECT_EQ(orders.trajectories[2].stamp(), kStart + 40.0);
}

}  // namespace
}  // namespace atmos
