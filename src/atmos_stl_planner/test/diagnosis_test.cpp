#include "atmos_stl_planner/diagnosis.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "atmos_model/steady_clock.h"
#include "atmos_stl_planner/choice_search.h"

namespace atmos::stl {
namespace {

Specification room(const std::string& formulas) {
  return parse_specification(
      "name: room\nhorizon_s: 40\nworkspace: {min_m: [0, 0], max_m: [4, 3]}\nregions:\n"
      "  - {name: A, center_m: [1, 2.4], size_m: [0.6, 0.6]}\n  - {name: B, center_m: [3, 2.4], size_m: "
      "[0.4, 0.4]}\n"
      "robots:\n  - name: R\n    start: {x_m: 1, y_m: 0.5}\n    end: {x_m: 3, y_m: 0.5}\n    radius_m: 0.2\n"
      "    max_velocity_m_s: 0.2\n    max_acceleration_m_s2: 0.1\n    formulas:\n" +
          formulas,
      "room.yaml");
}

bool mentions(const std::vector<Relaxation>& relaxations, const std::string& text) {
  for (const Relaxation& relaxation : relaxations) {
    if (relaxation.statement.find(text) != std::string::npos) return true;
  }
  return false;
}

TEST(Diagnosis, NamesTheGuiltyClauseAndTheSmallestRelaxation) {
  const Specification spec = room("      - F[0,20] in(A)\n      - F[0,8] in(B)\n      - G[0,40] x <= 3.5\n");
  const auto solver = make_choice_search(make_cbc(), steady_seconds);
  Diagnosis diagnosis(spec, *solver, steady_seconds);
  const Conflict conflict = diagnosis.conflict(10.0);
  EXPECT_TRUE(conflict.minimal);
  EXPECT_EQ(conflict.parts, (std::vector<std::string>{"velocity limit", "F[0,8] R.in(B)"}));
  const std::vector<Relaxation> ways = diagnosis.relaxations(conflict, 10.0);
  ASSERT_EQ(ways.size(), 2u);
  EXPECT_TRUE(mentions(ways, " instead of F[0,8] R.in(B)")) << ways[0].statement;
  EXPECT_TRUE(mentions(ways, "velocity limit of "));
  // It is 1.81 m along x to 0.01 m inside B: 9.05 s at 0.2 m/s and a second to get up to it, later still by
  // way of A.
  for (const Relaxation& way : ways) {
    double late = 0.0;
    if (std::sscanf(way.statement.c_str(), "F[0,%lf]", &late) == 1) {
      EXPECT_GT(late, 10.0);
      EXPECT_LT(late, 16.0);
    }
  }
}

TEST(Diagnosis, AContradictionNeedsNoLimits) {
  const Specification spec =
      room("      - F[10,20] in(A)\n      - F[0,40] in(B)\n      - G[0,40] not in(A)\n");
  const auto solver = make_choice_search(make_cbc(), steady_seconds);
  const Conflict conflict = Diagnosis(spec, *solver, steady_seconds).conflict(10.0);
  EXPECT_EQ(conflict.parts, (std::vector<std::string>{"F[10,20] R.in(A)", "G[0,40] not R.in(A)"}));
}

TEST(Diagnosis, WhatIsPossibleHasNoConflict) {
  const Specification spec = room("      - F[0,40] in(A)\n");
  const auto solver = make_choice_search(make_cbc(), steady_seconds);
  EXPECT_TRUE(Diagnosis(spec, *solver, steady_seconds).conflict(10.0).parts.empty());
}

TEST(Diagnosis, WithoutTimeItSaysThatItIsNotMinimal) {
  const Specification spec = room("      - F[10,20] in(A)\n      - G[0,40] not in(A)\n");
  const auto solver = make_choice_search(make_cbc(), steady_seconds);
  // Time passes by itself: half a second at every look at the clock.
  double now = 0.0;
  Diagnosis hurried(spec, *solver, [&now] { return now += 0.5; });
  const Conflict conflict = hurried.conflict(6.0);
  EXPECT_TRUE(conflict.parts.empty() || !conflict.minimal);
}

}  // namespace
}  // namespace atmos::stl
