// Controller and flight controller together, at the levels at which the latter allocates: what is declared in
// a model.yaml is known to both.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "atmos_nmpc/config.h"
#include "atmos_px4_bridge/flight_controller.h"
#include "closed_loop.h"

namespace atmos {
namespace {

using testing::kDegree;
using testing::kLabNoise;
using testing::kStart;
using testing::stopped_clock;

class Levels : public ::testing::TestWithParam<std::string> {
 protected:
  static Vehicle vehicle() { return load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml"); }
  static ControllerConfig controller(const std::vector<Effect>& declared) {
    ControllerConfig config =
        load_controller(ATMOS_CONFIG_DIR "/controller/" + GetParam() + ".yaml", vehicle());
    config.model = declared;
    return config;
  }
  static FlightControllerConfig flight_controller(const std::vector<Effect>& declared) {
    FlightControllerConfig config =
        load_flight_controller(ATMOS_CONFIG_DIR "/flight_controller/atmos.yaml", vehicle());
    config.model = declared;
    return config;
  }
};

// As the node does it; closed valves are a thruster command at every level.
ThrusterCommand carried_out(FlightController& core, CommandLevel level, const ControlDecision& decision,
                            double yaw_rate) {
  const double stamp = decision.command.stamp_s;
  core.take_odometry(stamp, yaw_rate, stamp);
  const bool closed = decision.mode == ControlMode::kClosed || decision.mode == ControlMode::kWaiting;
  const auto order = closed || level == CommandLevel::kThrusters ? core.take_command(decision.command, stamp)
                     : level == CommandLevel::kWrench
                         ? core.take_wrench(stamp, decision.wrench, stamp)
                         : core.take_rate(stamp, decision.wrench.head<2>(), decision.yaw_rate, stamp);
  return order->command;
}

TEST_P(Levels, EverySetPointIsReachedWithAnyOneThrusterDeadAndDeclaredUnderCoupling) {
  for (int number = 1; number <= 8; ++number) {
    SCOPED_TRACE("dead: " + std::to_string(number));
    ThrusterDead dead;
    dead.thruster = number;
    SupplyCoupling coupling;
    coupling.fraction_per_open_thruster = 0.125;
    const std::vector<Effect> effects = {dead, coupling};
    Controller control(vehicle(), controller(effects), true, stopped_clock);
    FlightController core(vehicle(), flight_controller(effects), Pacing::kLockstep);
    testing::Flight flight(vehicle(), control, kStart, {}, kLabNoise, 5, effects);
    flight.set_flight_controller([&](const ControlDecision& decision, double yaw_rate) {
      return carried_out(core, control.level(), decision, yaw_rate);
    });
    const Eigen::Vector3d goals[] = {{1, 0, 45 * kDegree}, {0, 1, 0}};
    for (const Eigen::Vector3d& goal : goals) {
      control.add_goal(testing::planar_goal(flight.now(), goal[0], goal[1], goal[2]));
      for (int k = 0; k < 200; ++k) {
        const testing::FlightRow row = flight.period();
        ASSERT_EQ(row.decision.mode, ControlMode::kSolved) << name_of(row.decision.solve.status);
      }
      EXPECT_LT((flight.truth().p_WC - goal.head<2>()).norm(), 0.02);
      EXPECT_NEAR(flight.truth().yaw, goal[2], 2.0 * kDegree);
    }
  }
}

// Around an obstacle in the way, past another robot that crosses, and within an area whatever is asked for.
TEST_P(Levels, KeepsAwayFromPlaces) {
  struct Case {
    Eigen::Vector2d start, goal;
    const char* name;
  };
  for (const Case& flown : {Case{{-1.0, 0.1}, {1.0, 0.0}, "obstacle"}, Case{{-1.0, 0.0}, {1.0, 0.0}, "robot"},
                            Case{{0.0, 0.0}, {2.0, 0.2}, "area"}}) {
    SCOPED_TRACE(flown.name);
    const bool obstacle = flown.name == std::string("obstacle"), robot = flown.name == std::string("robot"),
               area = flown.name == std::string("area");
    ControllerConfig config = controller({});
    if (obstacle) config.places.obstacles = {{{0.0, 0.0}, 0.4}};
    if (robot) config.robot_distance_m = 0.6;
    if (area)
      config.places.walls = {{{1.0, 0.0}, 0.5}, {{0.0, 1.0}, 0.5}, {{-1.0, 0.0}, 0.5}, {{0.0, -1.0}, 0.5}};
    Controller control(vehicle(), config, true, stopped_clock);
    FlightController core(vehicle(), flight_controller({}), Pacing::kLockstep);
    control.add_goal(testing::planar_goal(kStart, flown.goal.x(), flown.goal.y(), 0.0));
    PlanarState<double> at;
    at.p_WC = flown.start;
    testing::Flight flight(vehicle(), control, kStart, at, kLabNoise, 8);
    flight.set_flight_controller([&](const ControlDecision& decision, double yaw_rate) {
      return carried_out(core, control.level(), decision, yaw_rate);
    });
    double nearest = 10.0, furthest = 0.0;
    for (int k = 0; k < 300; ++k) {
      const double t = flight.now() - kStart;
      const Eigen::Vector2d other(0.0, robot ? -1.0 + 0.2 * std::min(t, 10.0) : 0.0);
      if (robot) control.see_robot("other", flight.now(), other, {0.0, t < 10.0 ? 0.2 : 0.0});
      const testing::FlightRow row = flight.period();
      EXPECT_EQ(row.decision.mode, ControlMode::kSolved) << k << name_of(row.decision.solve.status);
      nearest = std::min(nearest, (row.truth.p_WC - other).norm());
      furthest = std::max(furthest, row.truth.p_WC.x());
    }
    std::printf("%s, %s: nearest %.3f m, furthest %.3f m\n", GetParam().c_str(), flown.name, nearest,
                furthest);
    if (obstacle) {
      EXPECT_GT(nearest, 0.38);
    }
    if (robot) {
      EXPECT_GT(nearest, 0.57);
    }
    const Eigen::Vector2d end = flight.truth().p_WC;
    if (area) {
      // Soft: pulled by a goal 1.5 m beyond the wall it rests a little before it.
      EXPECT_LT(furthest, 0.53);
      EXPECT_GT(end.x(), 0.4);
      EXPECT_NEAR(end.y(), flown.goal.y(), 0.02);
    } else {
      EXPECT_LT((end - flown.goal).norm(), 0.02);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Formulations, Levels, ::testing::Values("wrench", "rate", "offset_free_wrench"));

}  // namespace
}  // namespace atmos
