// Soft constraints in closed loop: an area to keep in, obstacles, other robots, and the thrusters' polytope.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "atmos_model/allocator.h"
#include "atmos_nmpc/config.h"
#include "closed_loop.h"

namespace atmos {
namespace {

using testing::kDegree;
using testing::kLabNoise;
using testing::kStart;
using testing::stopped_clock;

class PlacesTest : public ::testing::TestWithParam<std::string> {
 protected:
  ControllerConfig config_ =
      load_controller(ATMOS_CONFIG_DIR "/controller/" + GetParam() + ".yaml", vehicle());
  static Vehicle vehicle() { return load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml"); }

  // Flies from `start` to `goal`; calls look() in every period.
  Eigen::Vector2d fly(
      const Eigen::Vector2d& start, const Eigen::Vector2d& goal,
      const std::function<void(const testing::FlightRow&)>& look,
      const std::function<void(Controller&, double)>& before = [](Controller&, double) {}) {
    Controller controller(vehicle(), config_, true, stopped_clock);
    controller.add_goal(testing::planar_goal(kStart, goal.x(), goal.y(), 0.0));
    PlanarState<double> at;
    at.p_WC = start;
    testing::Flight flight(vehicle(), controller, kStart, at, kLabNoise, 8);
    for (int k = 0; k < 300; ++k) {
      before(controller, flight.now());
      const testing::FlightRow row = flight.period();
      EXPECT_EQ(row.decision.mode, ControlMode::kSolved) << k << name_of(row.decision.solve.status);
      look(row);
    }
    return flight.truth().p_WC;
  }
};

TEST_P(PlacesTest, GoesAroundAnObstacle) {
  config_.places.obstacles = {{{0.0, 0.0}, 0.4}};
  double nearest = 10.0;
  const Eigen::Vector2d end = fly({-1.0, 0.1}, {1.0, 0.0}, [&](const testing::FlightRow& row) {
    nearest = std::min(nearest, row.truth.p_WC.norm());
  });
  // Soft: on the straight line it would have come within 0.05 m.
  EXPECT_GT(nearest, 0.38);
  std::printf("%.0f mm inside an obstacle of 0.4 m\n", 1e3 * (0.4 - nearest));
  EXPECT_LT((end - Eigen::Vector2d(1.0, 0.0)).norm(), 0.02);
}

TEST_P(PlacesTest, StaysInItsAreaWhateverIsAskedFor) {
  config_.places.walls = {{{1.0, 0.0}, 0.5}, {{0.0, 1.0}, 0.5}, {{-1.0, 0.0}, 0.5}, {{0.0, -1.0}, 0.5}};
  double furthest = 0.0;
  const Eigen::Vector2d end = fly({0.0, 0.0}, {2.0, 0.2}, [&](const testing::FlightRow& row) {
    furthest = std::max(furthest, row.truth.p_WC.x());
  });
  EXPECT_LT(furthest, 0.53);
  EXPECT_GT(end.x(), 0.4);
  EXPECT_NEAR(end.y(), 0.2, 0.02);
}

TEST_P(PlacesTest, LetsAnotherRobotPass) {
  config_.robot_distance_m = 0.6;
  double nearest = 10.0;
  // It crosses our way from the right, and stands still after 10 s, out of the way.
  const auto other = [](double t) { return Eigen::Vector2d(0.0, -1.0 + 0.2 * std::min(t, 10.0)); };
  const Eigen::Vector2d end = fly(
      {-1.0, 0.0}, {1.0, 0.0},
      [&](const testing::FlightRow& row) {
        nearest = std::min(nearest, (row.truth.p_WC - other(row.time_s - kStart)).norm());
      },
      [&](Controller& controller, double now) {
        const double t = now - kStart;
        controller.see_robot("other", now, other(t), {0.0, t < 10.0 ? 0.2 : 0.0});
      });
  EXPECT_GT(nearest, 0.57);
  EXPECT_LT((end - Eigen::Vector2d(1.0, 0.0)).norm(), 0.02);
}

// The rate level needs the flight controller: levels_test.
INSTANTIATE_TEST_SUITE_P(Formulations, PlacesTest,
                         ::testing::Values("direct_allocation", "wrench", "offset_free_direct_allocation",
                                           "offset_free_wrench"));

using Polytope = PlacesTest;

TEST_P(Polytope, WrenchesStayWithinWhatTheThrustersGiveTogether) {
  // Bounds of a single axis at its most: together the thrusters cannot give them.
  config_.force_n = 3.4;
  config_.torque_n_m = 0.8;
  const Allocator allocator(vehicle());
  double worst[2];
  for (const bool polytope : {false, true}) {
    config_.polytope = polytope;
    worst[polytope] = 10.0;
    fly({0.0, 0.0}, {1.5, 1.2}, [&](const testing::FlightRow& row) {
      if (row.decision.wrench.norm() > 1e-3)
        worst[polytope] = std::min(worst[polytope], allocator.attainable_scale(row.decision.wrench));
    });
  }
  EXPECT_LT(worst[false], 0.95);
  EXPECT_GT(worst[true], 0.97);
}
INSTANTIATE_TEST_SUITE_P(Wrench, Polytope, ::testing::Values("wrench"));

}  // namespace
}  // namespace atmos
