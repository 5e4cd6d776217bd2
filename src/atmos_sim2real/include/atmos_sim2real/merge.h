// Effects that a model.yaml holds as one.
#pragma once

#include "atmos_sim2real/search.h"

namespace atmos {

// A tilted floor under a height map is one height map (docs/effects.md).
void merge_floor(Fit& fit, std::vector<Claim>& claims);

// What is outside the vocabulary is one effect, however many laws it takes.
void merge_laws(Fit& fit, std::vector<Claim>& claims);

}  // namespace atmos
