// The paper's encoding ("Planning Schemes"): every segment is a Bezier curve in space r(s) and in time h(s),
// both unknown. Times of visits are not bound to a grid, but only the paper's fragment can be said
// (eventually and always of predicates, conjunction, disjunction), and acceleration can only be penalised.
#pragma once

#include "atmos_stl_planner/milp.h"
#include "atmos_stl_planner/motion.h"
#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

struct FreeTimeResult {
  MilpStatus status = MilpStatus::kFailed;
  Motion motion;  // empty without a solution
  double robustness_m = 0.0;
  std::string unsupported;  // the clause that the fragment does not cover; then the status is kFailed
};

// Robots share h. Tries the geometric bound of robustness first and bisects below it.
FreeTimeResult plan_in_free_time(const Specification& specification, MilpSolver& solver, double limit_s);

}  // namespace atmos::stl
