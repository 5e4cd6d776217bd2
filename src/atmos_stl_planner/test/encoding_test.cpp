// The encoder against the checker and the definition, on motions that it is given instead of choosing them.
#include "atmos_stl_planner/grid_encoding.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cstdlib>

#include "atmos_model/steady_clock.h"
#include "atmos_stl_planner/choice_search.h"
#include "brute_force.h"
#include "formulas.h"
#include "motions.h"

namespace atmos::stl {
namespace {

constexpr int kHorizon_s = 4;
constexpr double kStep_s = 0.25;

Specification specification_of(const FormulaPtr& formula, const std::vector<Region>& regions) {
  Specification spec;
  spec.name = "random";
  spec.horizon_s = kHorizon_s;
  spec.workspace = box({-30, -30}, {30, 30});
  spec.regions = regions;
  for (const char* name : {"R1", "R2"}) {
    Robot robot;
    robot.name = name;
    robot.start.p_WB.setZero();
    robot.max_velocity_m_s = robot.max_acceleration_m_s2 = 100.0;
    spec.robots.push_back(robot);
  }
  spec.clauses = {{"random", formula, 0}};
  return spec;
}

struct Pair {
  FormulaPtr formula;
  std::vector<Region> regions;
  Motion motion;
};

// Whether the encoding of the formula has a solution with that robustness when the motion is fixed.
bool encoded(const Pair& pair, double robustness_m) {
  const Specification spec = specification_of(pair.formula, pair.regions);
  GridProblem problem;
  problem.specification = &spec;
  problem.scope = Scope::all(spec);
  problem.scope.separation = false;
  for (int k = 0; k * kStep_s <= kHorizon_s; ++k) problem.knots.push_back(k * kStep_s);
  const Motion cut = pair.motion.cut_at(problem.knots);
  problem.fixed = {{0, &cut}, {1, &cut}};
  problem.planned.assign(2, false);
  const GridEncoding encoding(problem, robustness_m, robustness_m);
  const auto solver = make_choice_search(make_cbc(), steady_seconds);
  const MilpResult result = solver->solve(encoding.model(), 20.0);
  if (!result.has_solution()) RC_ASSERT(result.status == MilpStatus::kInfeasible);
  return result.has_solution();
}

TEST(GridEncoding, AgreesWithCheckerAndDefinition) {
  const int pairs = std::getenv("ATMOS_LONG_TESTS") != nullptr ? 1000 : 100;
  int count = 0, above = 0;
  const bool good = rc::check("encoder, checker and definition agree", [&] {
    // rapidcheck draws 100 cases; the count wanted is reached by repeating inside each.
    for (int repeat = 0; repeat < std::max(1, pairs / 100) && count < pairs; ++repeat, ++count) {
      const Pair pair{random_formula(2, 3, 2, kHorizon_s, 0.5), random_regions(kHorizon_s),
                      random_motion(2, kHorizon_s, false, 2, true)};
      const double exact = Checker(pair.regions, pair.motion).robustness(pair.formula);
      if (!std::isfinite(exact)) continue;
      const double speed = top_speed(pair.motion) + 12.0 / (0.3 * kHorizon_s);
      const double sampled = BruteForce(pair.regions, pair.motion, 0.01).robustness(*pair.formula);
      RC_ASSERT(std::abs(exact - sampled) <= BruteForce::slope(speed) * 0.01 + 1e-6);
      RC_ASSERT(!encoded(pair, exact + 1e-5));  // never more than the truth
      // And not much less: each level of nesting may lose what happens within a segment.
      const double loss = 3.0 * BruteForce::slope(speed) * kStep_s;
      RC_ASSERT(encoded(pair, exact - loss));
      if (encoded(pair, exact - 0.1 * loss)) ++above;
    }
  });
  EXPECT_TRUE(good);
  EXPECT_EQ(count, pairs);
  EXPECT_GT(above, pairs / 2);
}

TEST(TimeGrid, HasEveryWindowEnd) {
  Specification spec = specification_of(parse_formula("F[1,2.5] G[0,0.5] in(A)", {{"R1"}, {"A"}, 0}), {});
  const std::vector<double> knots = time_grid(spec, 2.0);
  for (const double end : {0.0, 1.0, 1.5, 2.5, 3.0, 4.0})
    EXPECT_TRUE(std::any_of(knots.begin(), knots.end(), [end](double t) {
      return std::abs(t - end) < 1e-12;
    })) << end;
  for (std::size_t k = 1; k < knots.size(); ++k) EXPECT_LE(knots[k] - knots[k - 1], 2.0 + 1e-9);
}

TEST(ChoiceSearch, AgreesWithBranchAndBoundOnFeasibility) {
  const Specification spec = load_specification(ATMOS_CONFIG_DIR "/stl/single.yaml");
  for (const double robustness : {0.1, 0.25, 0.26}) {
    GridProblem problem;
    problem.specification = &spec;
    problem.scope = Scope::all(spec);
    problem.knots = time_grid(spec, 10.0);
    problem.planned.assign(1, true);
    const GridEncoding encoding(problem, robustness, robustness);
    const bool cbc = make_cbc()->solve(encoding.model(), 20.0).has_solution();
    const bool search =
        make_choice_search(make_cbc(), steady_seconds)->solve(encoding.model(), 20.0).has_solution();
    EXPECT_EQ(cbc, robustness <= 0.25);
    EXPECT_EQ(search, cbc);
  }
}

TEST(MilpSolver, EveryStatus) {
  const auto cbc = make_cbc();
  MilpModel model;
  const int a = model.add_binary(), b = model.add_binary();
  model.add_row(1.0, {{{a, 1.0}, {b, 1.0}}, 0.0}, 1.0);
  model.columns[0].cost = 1.0;
  const MilpResult solved = cbc->solve(model, 5.0);
  ASSERT_EQ(solved.status, MilpStatus::kOptimal);
  EXPECT_EQ(solved.x, (std::vector<double>{0.0, 1.0}));
  EXPECT_EQ(cbc->solve(model, 0.0).status, MilpStatus::kLimit);
  model.add_row(3.0, {{{a, 1.0}, {b, 1.0}}, 0.0}, kUnbounded);
  EXPECT_EQ(cbc->solve(model, 5.0).status, MilpStatus::kInfeasible);
  MilpModel linear;
  linear.add_column(0.0, 1.0, -1.0);
  EXPECT_EQ(cbc->solve(linear, 5.0).x, std::vector<double>{1.0});
  linear.add_row(2.0, {{{0, 1.0}}, 0.0}, kUnbounded);
  EXPECT_EQ(cbc->solve(linear, 5.0).status, MilpStatus::kInfeasible);
}

}  // namespace
}  // namespace atmos::stl
