// Which prior a map over the floor deserves: of smooth random fields of several amplitudes and lengths, and
// of hills, the one under which the flights are most likely.
#pragma once

#include "atmos_sim2real/fit.h"

namespace atmos {

// The fit with the prior that suits effect `map` (floor_unevenness or airflow) on the nodes it has.
Fit with_best_prior(const Problem& problem, Fit fit, std::size_t map);

// The fit with a map that goes on so far beyond its nodes as the prior that suits it has it: a field or, of
// heights, hills; heights on nodes as near to each other as narrow hills ask for. Predictions need the former
// where flights go elsewhere.
Fit relaid(const Problem& problem, Fit fit, std::size_t map, double beyond_m);

}  // namespace atmos
