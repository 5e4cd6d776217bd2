// Depth-first search over the choices of a mixed-integer problem whose binaries are all of one kind: exactly
// one of a group is 1 if a condition holds, and each switches rows on. A choice is made only where the
// solution of the linear problem breaks every option of a group, the least broken option first; what is
// switched off is not in the linear problem at all; from a dead end it goes back to the latest choice that
// the proof of the dead end rests on. On planning problems this finds a motion some ten times as fast as
// branch and bound, which sees little in relaxed big-M rows.
#pragma once

#include <functional>
#include <memory>

#include "atmos_stl_planner/milp.h"

namespace atmos::stl {

// Returns the first solution found (kFeasible; of least cost for its choices) or proves that there is none.
// Problems of another kind, and those on which it makes no headway, go to `fallback`. `clock`: seconds of
// wall time since any origin. Deterministic unless the limit ends it.
std::unique_ptr<MilpSolver> make_choice_search(std::unique_ptr<MilpSolver> fallback,
                                               std::function<double()> clock);

}  // namespace atmos::stl
