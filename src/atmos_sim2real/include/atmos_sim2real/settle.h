// A model, its noise and the motion along which its forces are evaluated made consistent with each other.
#pragma once

#include "atmos_sim2real/search.h"

namespace atmos {

// Noise in which a valve that stays open over several commands makes one pulse of them, or one of each: as
// the flights have it under these effects. They are smoothed under the noise that is returned.
NoiseModel with_likelier_pulses(const Problem& problem, const std::vector<Effect>& effects,
                                const NoiseModel& present, double looseness);

// Fits along the motion that the model itself implies, until that no longer changes: friction that nearly
// holds the robot shows itself only step by step.
Fit settled(const Problem& problem, Fit current, double looseness);

// Pushes were claimed when less was known, which may have hidden some and made up others: reviews them.
Fit with_pushes_reviewed(const Problem& problem, Fit current, double looseness, const SearchOptions& options);

}  // namespace atmos
