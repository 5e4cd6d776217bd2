// Every formulation follows a trajectory with preview; the baselines reach set-points.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "atmos_nmpc/config.h"
#include "closed_loop.h"
#include "curves.h"

namespace atmos {
namespace {

using testing::kDegree;
using testing::kLabNoise;
using testing::kStart;
using testing::stopped_clock;

class Tracking : public ::testing::TestWithParam<std::string> {
 protected:
  ControllerConfig config() const {
    return load_controller(ATMOS_CONFIG_DIR "/controller/" + GetParam() + ".yaml", vehicle_);
  }
  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
};

TEST_P(Tracking, FollowsACircleThenRestsAtItsEnd) {
  Controller controller(vehicle_, config(), true, stopped_clock);
  controller.add_goal(testing::planar_goal(kStart, 0.5, 0.0, 0.0));
  controller.add_trajectory(testing::circle(kStart + 2.0, 40.0, 0.5));
  PlanarState<double> start;
  start.p_WC.x() = 0.5;
  testing::Flight flight(vehicle_, controller, kStart, start, kLabNoise, 3);
  const testing::TrackingError error = testing::track(flight, testing::circle(kStart + 2.0, 40.0, 0.5), 420);
  // The baselines know where the reference is and how it accelerates, but not where it goes.
  const bool preview = GetParam() != "lqr" && GetParam() != "pd";
  EXPECT_LT(error.position_rms_m, preview ? 0.01 : 0.05);
  EXPECT_LT(error.yaw_rms_rad, preview ? 1.5 * kDegree : 5.0 * kDegree);
  for (int k = 0; k < 80; ++k) flight.period();
  EXPECT_LT((flight.truth().p_WC - Eigen::Vector2d(0.5, 0.0)).norm(), 0.01);
  EXPECT_LT(flight.truth().v_WC.norm(), 0.01);
}

TEST_P(Tracking, ReachesASetPoint) {
  Controller controller(vehicle_, config(), true, stopped_clock);
  controller.add_goal(testing::planar_goal(kStart, 1.0, -0.5, 90.0 * kDegree));
  testing::Flight flight(vehicle_, controller, kStart, {}, kLabNoise, 4);
  for (int k = 0; k < 250; ++k) {
    const testing::FlightRow row = flight.period();
    ASSERT_EQ(row.decision.mode, ControlMode::kSolved) << k;
  }
  EXPECT_LT((flight.truth().p_WC - Eigen::Vector2d(1.0, -0.5)).norm(), 0.01);
  EXPECT_NEAR(flight.truth().yaw, 90.0 * kDegree, 1.0 * kDegree);
}

TEST_P(Tracking, BadTrajectoriesAreRefusedAndWhatHoldsGoesOn) {
  Controller controller(vehicle_, config(), true, stopped_clock);
  controller.add_goal(testing::planar_goal(kStart, 0.2, 0.0, 0.0));
  testing::Flight flight(vehicle_, controller, kStart, {}, kLabNoise, 5);
  for (int k = 0; k < 10; ++k) flight.period();
  std::vector<TrajectoryPoint> broken = testing::circle(kStart + 2.0, 40.0, 0.5);
  broken[5].p_WB[0] = std::nan("");
  controller.add_trajectory(broken);
  controller.add_trajectory({});
  controller.add_trajectory(testing::circle(kStart - 30.0, 20.0, 0.5));  // is over
  EXPECT_EQ(controller.counters().rejected_goals, 3U);
  for (int k = 0; k < 150; ++k) flight.period();
  EXPECT_LT((flight.truth().p_WC - Eigen::Vector2d(0.2, 0.0)).norm(), 0.01);
}

INSTANTIATE_TEST_SUITE_P(Controllers, Tracking,
                         ::testing::Values("direct_allocation", "wrench", "offset_free_wrench", "lqr", "pd"));

}  // namespace
}  // namespace atmos
