// From a specification to a certified motion.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "atmos_stl_planner/checker.h"
#include "atmos_stl_planner/grid_encoding.h"
#include "atmos_stl_planner/milp.h"
#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

// Seconds of wall time since any origin; the planner reads no clock by itself.
using Clock = std::function<double()>;

enum class PlanStatus {
  kPlanned,     // certified
  kInfeasible,  // proven on every grid that was asked for
  kTimeLimit,   // no certified plan before the limit
  kFailed,      // solver trouble
};

struct Plan {
  PlanStatus status = PlanStatus::kFailed;
  Motion motion;                   // of kPlanned
  Certificate certificate;         // of kPlanned
  double bound_m = 0.0;            // no motion has more robustness
  double grid_bound_m = 0.0;       // no motion on the grid used has more
  double time_robustness_s = 0.0;  // guaranteed at full robustness, if asked for
  double segment_s = 0.0;          // longest segment of the grid used
  std::string method;              // how it was found and what that does not guarantee
  double first_plan_s = 0.0;       // wall time until the first certified plan, and in all
  double total_s = 0.0;
};

class Planner {
 public:
  // `solver` must outlive the planner.
  Planner(const Specification& specification, MilpSolver& solver, Clock clock);

  // The best certified plan within the specification's time limit. `past`: what was flown, when planning on
  // the way. `on_better` is called with every certified plan that is better than the one before it.
  Plan plan(const Past* past = nullptr, const std::function<void(const Plan&)>& on_better = {});

  // Whether the scope has a motion with that robustness, on one of all grids or on the coarsest alone;
  // certifies nothing. For diagnoses.
  MilpStatus feasible(const Scope& scope, double robustness_m, double limit_s, bool coarsest_alone = false);

 private:
  struct Found;
  struct Search;
  const Specification& spec_;
  MilpSolver& solver_;
  Clock clock_;
};

}  // namespace atmos::stl
