#include "atmos_stl_planner/planner.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "atmos_model/steady_clock.h"
#include "atmos_stl_planner/choice_search.h"

namespace atmos::stl {
namespace {

const std::string kFolder = ATMOS_CONFIG_DIR "/stl/";

Plan plan_of(const Specification& spec, const Past* past = nullptr) {
  const auto solver = make_choice_search(make_cbc(), steady_seconds);
  const Plan plan = Planner(spec, *solver, steady_seconds).plan(past);
  std::fprintf(stderr, "%s: status %d, robustness %.4f of %.4f m, first after %.3f s, total %.3f s, %s\n",
               spec.name.c_str(), static_cast<int>(plan.status), plan.certificate.robustness_m, plan.bound_m,
               plan.first_plan_s, plan.total_s, plan.method.c_str());
  return plan;
}

// One robot in a room with the regions A, B and Obs.
Specification room(const std::string& formulas, const std::string& more = "", double end_x = 3.0) {
  std::string text =
      "name: room\nhorizon_s: 40\nworkspace: {min_m: [0, 0], max_m: [4, 3]}\nregions:\n"
      "  - {name: A, center_m: [1, 2.4], size_m: [0.6, 0.6]}\n"
      "  - {name: B, center_m: [3, 2.4], size_m: [0.4, 0.4]}\n"
      "  - {name: Obs, center_m: [2, 1], size_m: [0.6, 2.0]}\n" +
      more + "robots:\n  - name: R\n    start: {x_m: 1, y_m: 0.5}\n    end: {x_m: " + std::to_string(end_x) +
      ", y_m: 0.5}\n    radius_m: 0.2\n    max_velocity_m_s: 0.4\n    max_acceleration_m_s2: 0.1\n"
      "    formulas:\n";
  return parse_specification(text + formulas, "room.yaml");
}

TEST(Planner, ThePapersScenariosReachTheBoundOfGeometry) {
  for (const char* name : {"single.yaml", "two_robots.yaml"}) {
    SCOPED_TRACE(name);
    const Specification spec = load_specification(kFolder + name);
    const Plan plan = plan_of(spec);
    ASSERT_EQ(plan.status, PlanStatus::kPlanned);
    EXPECT_NEAR(plan.certificate.robustness_m, 0.25, 1e-6);
    EXPECT_NEAR(plan.bound_m, 0.25, 1e-9);
    EXPECT_LE(plan.certificate.peak_acceleration_share, 1.0 + 1e-6);
    EXPECT_LE(plan.certificate.peak_velocity_share, 1.0 + 1e-6);
    EXPECT_GE(plan.certificate.separation_m, -1e-6);
  }
}

TEST(Planner, TheSameFileGivesTheSamePlan) {
  const Specification spec = load_specification(kFolder + "two_robots.yaml");
  const Plan a = plan_of(spec), b = plan_of(load_specification(kFolder + "two_robots.yaml"));
  ASSERT_EQ(a.motion.segments().size(), b.motion.segments().size());
  for (std::size_t k = 0; k < a.motion.segments().size(); ++k) {
    EXPECT_EQ(a.motion.segments()[k].time, b.motion.segments()[k].time);
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_EQ(a.motion.segments()[k].position[i], b.motion.segments()[k].position[i]);
  }
}

TEST(Planner, NestedFormulas) {
  for (const char* formulas :
       {"      - F[0,30] (in(A) and F[0,5] G[0,2] not in(A))\n      - G[0,40] not in(Obs)\n",
        "      - x <= 1.5 U[5,30] in(A)\n      - G[0,40] not in(Obs)\n",
        "      - G[0,20] F[0,20] in(A)\n      - G[0,40] not in(Obs)\n",
        "      - F[0,20] in(A) implies F[20,40] in(B)\n      - G[0,40] not in(Obs)\n      - F[0,20] in(A)\n",
        "      - F[5,30] G[0,4] in(A) or F[5,10] in(B)\n",
        "      - not (not in(A) U[10,30] in(B))\n      - F[10,30] in(B)\n"}) {
    SCOPED_TRACE(formulas);
    const Plan plan = plan_of(room(formulas));
    ASSERT_EQ(plan.status, PlanStatus::kPlanned);
    EXPECT_GE(plan.certificate.robustness_m, 0.0);
  }
}

TEST(Planner, BisectsWhereGeometryIsNotReached) {
  // The gap between the obstacle and the wall is 1 m: 0.5 m from the one is what the workspace leaves... but
  // the speed does not allow both visits at their centres.
  const Plan plan = plan_of(room("      - F[0,6.3] in(A)\n      - G[0,40] not in(Obs)\n"));
  ASSERT_EQ(plan.status, PlanStatus::kPlanned);
  EXPECT_LT(plan.certificate.robustness_m, 0.29);
  EXPECT_GT(plan.certificate.robustness_m, 0.05);
  EXPECT_LE(plan.certificate.robustness_m, plan.grid_bound_m + 1e-6);
  EXPECT_LT(plan.grid_bound_m - plan.certificate.robustness_m, 0.003);
}

TEST(Planner, InfeasibleIsProven) {
  EXPECT_EQ(plan_of(room("      - F[0,2] in(B)\n")).status, PlanStatus::kInfeasible);
  EXPECT_EQ(plan_of(room("      - F[0,20] in(A)\n      - G[0,40] not in(A)\n")).status,
            PlanStatus::kInfeasible);
}

TEST(Planner, AWallOfObstaclesIsWaitedForAndPassed) {
  // A bar that bars the passage until it has moved away.
  const std::string moving =
      "obstacles:\n  - name: bar\n    center_m: [2, 1.5]\n    size_m: [0.2, 3.4]\n    path:\n"
      "      - {time_s: 15, displacement_m: [0, 0]}\n      - {time_s: 25, displacement_m: [0, 3.4]}\n";
  const Plan plan = plan_of(room("      - F[0,40] in(B)\n", moving));
  ASSERT_EQ(plan.status, PlanStatus::kPlanned);
  EXPECT_GE(plan.certificate.obstacle_m, -1e-6);
  EXPECT_LT(plan.motion.at(0, 15.0).p_WB.x(), 1.9);
  EXPECT_EQ(plan_of(room("      - F[0,15] in(B)\n", moving)).status, PlanStatus::kInfeasible);
}

TEST(Planner, TimeRobustnessIsMaximisedAfterSpace) {
  const std::string formulas = "      - F[5,35] in(A)\n      - G[0,40] not in(Obs)\n";
  Specification spec = room(formulas);
  spec.planner.time_robustness = true;
  const Plan plan = plan_of(spec);
  ASSERT_EQ(plan.status, PlanStatus::kPlanned);
  EXPECT_NEAR(plan.certificate.robustness_m, 0.3, 1e-6);
  EXPECT_NEAR(plan.time_robustness_s, 15.0,
              2.5 + 1e-6);  // the middle of the window, as near as the knots are
  EXPECT_GE(plan.certificate.clauses[0].lateness_s, plan.time_robustness_s - 1e-6);
  EXPECT_GE(plan.certificate.clauses[0].earliness_s, plan.time_robustness_s - 1e-6);
}

TEST(Planner, PlansOnTheWayFromWhatWasFlown) {
  const Specification spec = load_specification(kFolder + "two_robots.yaml");
  const Plan first = plan_of(spec);
  // Both robots flew the plan, with 3 cm of error, until 35 s.
  std::vector<double> times;
  std::vector<std::vector<Eigen::Vector2d>> points;
  for (int k = 0; k <= 350; ++k) {
    times.push_back(0.1 * k);
    points.push_back({first.motion.at(0, times.back()).p_WB + Eigen::Vector2d(0.03, 0.0),
                      first.motion.at(1, times.back()).p_WB - Eigen::Vector2d(0.0, 0.03)});
  }
  const Past past{polyline(times, points), {first.motion.at(0, 35.0).v_WB, first.motion.at(1, 35.0).v_WB}};
  const Plan again = plan_of(spec, &past);
  ASSERT_EQ(again.status, PlanStatus::kPlanned);
  EXPECT_NEAR(again.certificate.robustness_m, 0.22, 0.005);  // the past allows no more
  EXPECT_NEAR((again.motion.at(0, 35.0).p_WB - points.back()[0]).norm(), 0.0, 1e-9);
  EXPECT_NEAR((again.motion.at(0, 35.0 + 1e-6).v_WB - past.v_WB[0]).norm(), 0.0, 1e-4);
}

TEST(Planner, APlanThatWasNotCertifiedIsNeverHandedOut) {
  // A solver that hands out nonsense: the checker is what stands between it and the robot.
  class Liar : public MilpSolver {
   public:
    MilpResult solve(const MilpModel& model, double) override {
      return {MilpStatus::kOptimal, std::vector<double>(model.columns.size(), 0.5)};
    }
  } liar;
  int published = 0;
  const Specification spec = load_specification(kFolder + "single.yaml");
  const Plan plan =
      Planner(spec, liar, steady_seconds).plan(nullptr, [&published](const Plan&) { ++published; });
  EXPECT_EQ(plan.status, PlanStatus::kFailed);
  EXPECT_TRUE(plan.motion.empty());
  EXPECT_EQ(published, 0);
}

TEST(Planner, TheTimeLimitIsHard) {
  Specification spec = load_specification(kFolder + "two_robots.yaml");
  spec.planner.time_limit_s = 1e-4;
  const Plan plan = plan_of(spec);
  EXPECT_EQ(plan.status, PlanStatus::kTimeLimit);
  EXPECT_TRUE(plan.motion.empty());
}

TEST(Planner, OneAfterTheOtherSaysThatItIsIncomplete) {
  Specification spec = load_specification(kFolder + "two_robots.yaml");
  spec.planner.prioritised = true;
  const Plan plan = plan_of(spec);
  ASSERT_EQ(plan.status, PlanStatus::kPlanned);
  EXPECT_NE(plan.method.find("incomplete"), std::string::npos);
  EXPECT_GE(plan.certificate.separation_m, -1e-6);
}

TEST(Planner, FreeTimeReachesTheSameRobustness) {
  Specification spec = load_specification(kFolder + "single.yaml");
  spec.planner.encoding = Encoding::kFreeTime;
  const Plan plan = plan_of(spec);
  ASSERT_EQ(plan.status, PlanStatus::kPlanned);
  EXPECT_NEAR(plan.certificate.robustness_m, 0.25, 1e-6);
  EXPECT_LE(plan.certificate.peak_velocity_share, 1.0 + 1e-6);
}

}  // namespace
}  // namespace atmos::stl
