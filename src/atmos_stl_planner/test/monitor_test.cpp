#include "atmos_stl_planner/monitor.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "atmos_stl_planner/checker.h"
#include "atmos_stl_planner/grid_encoding.h"
#include "formulas.h"
#include "motions.h"

namespace atmos::stl {
namespace {

Specification room(const std::string& formulas) {
  return parse_specification(
      "name: room\nhorizon_s: 10\nworkspace: {min_m: [-3, -3], max_m: [3, 3]}\nregions:\n"
      "  - {name: A, center_m: [0, 0], size_m: [2, 2]}\nrobots:\n  - name: R\n    start: {x_m: -2, y_m: 0}\n"
      "    radius_m: 0.2\n    max_velocity_m_s: 1\n    max_acceleration_m_s2: 1\n    formulas:\n" +
          formulas,
      "room.yaml");
}

TEST(Monitor, IntervalsShrinkAndVerdictsStay) {
  Monitor monitor(room("      - F[2,6] in(A)\n      - G[0,8] x <= 2\n"));
  EXPECT_NEAR(monitor.clauses()[0].high_m, 1.0, 1e-9);
  EXPECT_NEAR(monitor.clauses()[0].low_m, -2.0, 1e-9);
  monitor.update(0.0, {{-2.0, 0.0}});
  EXPECT_EQ(monitor.verdict(), Verdict::kOpen);
  monitor.update(4.0, {{0.0, 0.0}});  // in A since 3 s, through the window's begin
  EXPECT_EQ(monitor.clauses()[0].verdict, Verdict::kSatisfied);
  EXPECT_NEAR(monitor.clauses()[0].low_m, 1.0, 1e-9);
  EXPECT_NEAR(monitor.clauses()[1].high_m, 2.0, 1e-9);
  EXPECT_EQ(monitor.clauses()[1].verdict, Verdict::kOpen);
  monitor.update(7.0, {{2.5, 0.0}});
  EXPECT_EQ(monitor.clauses()[1].verdict, Verdict::kViolated);
  EXPECT_EQ(monitor.verdict(), Verdict::kViolated);
  monitor.update(7.5, {{0.0, 0.0}});
  EXPECT_EQ(monitor.clauses()[1].verdict, Verdict::kViolated);
  EXPECT_NEAR(monitor.high_m(), -0.5, 1e-9);
}

TEST(Monitor, BadSamplesAreCountedAndIgnored) {
  Monitor monitor(room("      - G[0,8] x <= 2\n"));
  monitor.update(1.0, {{0.0, 0.0}});
  monitor.update(1.0, {{2.5, 0.0}});
  monitor.update(2.0, {{std::nan(""), 0.0}});
  monitor.update(std::nan(""), {{0.0, 0.0}});
  monitor.update(3.0, {});
  EXPECT_EQ(monitor.rejected(), 4u);
  EXPECT_EQ(monitor.clauses()[0].verdict, Verdict::kOpen);
}

TEST(Monitor, AnEventuallyIsLostWhenItsWindowIsOver) {
  Monitor monitor(room("      - F[0,3] in(A)\n"));
  monitor.update(0.0, {{-2.0, 0.0}});
  monitor.update(2.9, {{-2.0, 0.0}});
  EXPECT_EQ(monitor.verdict(), Verdict::kOpen);
  monitor.update(3.1, {{-1.5, 0.0}});
  EXPECT_EQ(monitor.verdict(), Verdict::kViolated);
  EXPECT_NEAR(monitor.low_m(), -0.75, 1e-9);  // where the robot was at 3 s
}

// At every time the interval holds what the checker says of the flown part with the best and the worst
// future; in the end both are the robustness of the flight.
RC_GTEST_PROP(Monitor, AgreesWithTheChecker, ()) {
  const int horizon_s = 6;
  Specification spec;
  spec.horizon_s = horizon_s;
  spec.workspace = box({-30, -30}, {30, 30});
  spec.regions = random_regions(horizon_s);
  spec.robots.resize(2);
  const FormulaPtr formula = random_formula(2, 3, 2, horizon_s, 0.5);
  spec.clauses = {{"random", formula, 0}};
  const Motion motion = random_motion(2, horizon_s, false, 5, true);
  const double tolerance = 2.0 * (top_speed(motion) + 12.0 / (0.3 * horizon_s)) * 0.1 + 1e-6;

  Monitor monitor(spec);
  std::vector<double> times;
  std::vector<std::vector<Eigen::Vector2d>> points;
  for (int k = 0; k <= 100 * horizon_s; ++k) {
    times.push_back(0.01 * k);
    points.push_back({motion.at(0, times.back()).p_WB, motion.at(1, times.back()).p_WB});
    monitor.update(times.back(), points.back());
    if (k % 150 != 75) continue;
    for (const bool best : {true, false}) {
      Checker checker(spec.regions, polyline(times, points));
      checker.assume_beyond(horizon_s, [&](const Formula& f) {
        return best ? most_possible(spec, f) : least_possible(spec, f);
      });
      const double expected = checker.robustness(formula);
      const double found = best ? monitor.high_m() : monitor.low_m();
      if (std::isfinite(expected) || std::isfinite(found)) RC_ASSERT(std::abs(expected - found) <= tolerance);
    }
  }
  const double robustness = Checker(spec.regions, motion).robustness(formula);
  if (!std::isfinite(robustness)) return;
  RC_ASSERT(std::abs(monitor.low_m() - robustness) <= tolerance);
  RC_ASSERT(std::abs(monitor.high_m() - robustness) <= tolerance);
}

}  // namespace
}  // namespace atmos::stl
