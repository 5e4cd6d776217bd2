// When a thruster died: its pulses cut the flight into gaps, and any onset within one gap is as good as
// another.
#pragma once

#include "atmos_sim2real/fit.h"

namespace atmos {

// Walks with since_s of the dead thruster at `effect` from gap to gap, as long as a more likely one is near
// or some way off; the rest of the fit stays. An effect of another kind, or one that is there from the start,
// stays as it is.
Fit refine_onset(const Problem& problem, Fit fit, std::size_t effect);

// Standard deviation of since_s [s]: over the gaps nearby by their likelihood, and within each. 0 for a
// thruster that is dead from the start.
double onset_deviation(const Problem& problem, const Fit& fit, std::size_t effect);

}  // namespace atmos
