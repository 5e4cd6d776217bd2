#include "atmos_stl_planner/supervisor.h"

#include <gtest/gtest.h>

#include "atmos_model/steady_clock.h"
#include "atmos_stl_planner/choice_search.h"
#include "atmos_stl_planner/planner.h"
#include "atmos_stl_planner/trajectory_samples.h"

namespace atmos::stl {
namespace {

struct Flight {
  Specification spec = load_specification(ATMOS_CONFIG_DIR "/stl/single.yaml");
  std::unique_ptr<MilpSolver> solver = make_choice_search(make_cbc(), steady_seconds);
  Plan plan = Planner(spec, *solver, steady_seconds).plan();
};

TEST(Supervisor, PredictsThePlansRobustnessWhileItIsFollowed) {
  Flight flight;
  Supervisor supervisor(flight.spec, flight.plan.motion);
  EXPECT_FALSE(supervisor.predicted_m());
  for (int k = 0; k <= 200; ++k) supervisor.fly(0.1 * k, {flight.plan.motion.at(0, 0.1 * k).p_WB});
  EXPECT_NEAR(*supervisor.predicted_m(), 0.25, 0.005);
  supervisor.fly(20.1, {flight.plan.motion.at(0, 20.1).p_WB + Eigen::Vector2d(0.0, std::nan(""))});
  EXPECT_NEAR(supervisor.last_s(), 20.0, 1e-9);
}

// A robot that is pushed off its plan before its visit: the prediction falls, and a new plan from where it is
// brings the robustness back.
TEST(Supervisor, ANewPlanFromTheWayRestoresRobustness) {
  Flight flight;
  // The robot stands still for half of the time.
  Supervisor supervisor(flight.spec, flight.plan.motion);
  const double stuck = 5.0;
  for (int k = 0; k <= 250; ++k) {
    const double t = 0.1 * k;
    supervisor.fly(t, {flight.plan.motion.at(0, std::min(t, stuck)).p_WB});
  }
  const std::optional<Past> past = supervisor.past_at(26.0);
  ASSERT_TRUE(past);
  EXPECT_NEAR(past->motion.end_s(), 26.0, 1e-9);
  const Plan again = Planner(flight.spec, *flight.solver, steady_seconds).plan(&*past);
  ASSERT_EQ(again.status, PlanStatus::kPlanned);
  EXPECT_GT(again.certificate.robustness_m, 0.1);
  supervisor.follow(again.motion);
  EXPECT_NEAR(supervisor.plan().at(0, 26.0).p_WB.x(), past->motion.at(0, 26.0).p_WB.x(), 1e-6);
}

TEST(TrajectorySamples, FollowTheCurveAndTurnTheShortWay) {
  Flight flight;
  flight.spec.robots[0].start.yaw_rad = 3.0;
  flight.spec.robots[0].end->yaw_rad = -3.0;
  const auto points = samples(flight.spec, flight.plan.motion, 0, 0.1);
  EXPECT_NEAR(points.front().time_s, 0.0, 1e-12);
  EXPECT_NEAR(points.back().time_s, 60.0, 1e-12);
  EXPECT_NEAR(points.back().yaw_rad, 2.0 * M_PI - 3.0, 1e-9);
  double turned = 0.0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double h = points[i].time_s - points[i - 1].time_s;
    EXPECT_LE(h, 0.1 + 1e-9);
    EXPECT_GT(h, 0.0);
    turned += 0.5 * h * (points[i].yaw_rate_rad_s + points[i - 1].yaw_rate_rad_s);
    const Eigen::Vector2d middle =
        points[i - 1].state.p_WB + 0.5 * h * (points[i].state.v_WB + points[i - 1].state.v_WB);
    EXPECT_LT((middle - points[i].state.p_WB).norm(), 1e-3);
  }
  EXPECT_NEAR(turned, points.back().yaw_rad - 3.0, 1e-6);
  EXPECT_NEAR(samples(flight.spec, flight.plan.motion, 0, 0.1, 33.3).front().time_s, 33.3, 1e-12);
}

}  // namespace
}  // namespace atmos::stl
