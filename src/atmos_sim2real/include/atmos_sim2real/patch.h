// Where a patch of friction lies: its likelihood has many hills, and velocities smoothed under the wrong disc
// speak for that disc.
#pragma once

#include "atmos_sim2real/fit.h"

namespace atmos {

// Tries other discs around the one of `effect`, each with the coefficient that suits it and along the motion
// that it implies itself; an effect of another kind stays as it is. The result needs a fit; the flights are
// smoothed under it, with `looseness` as in Flight::smooth.
Fit refine_patch(const Problem& problem, Fit fit, std::size_t effect, double looseness);

}  // namespace atmos
