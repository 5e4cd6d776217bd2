// Whether an effect helps on data its fit has not seen, and whether it survives resampling. Both by blocks,
// linearised at the joint fit: leaving a block out moves the parameters by one Newton step, which costs no
// further fit.
#pragma once

#include "atmos_sim2real/fit.h"

namespace atmos {

struct BlockEvidence {
  double heldout_gain = 0.0;  // nats on left-out blocks: `fitted` over `base`, each at its own noise
  double inclusion = 0.0;     // share of bootstrap resamples of the blocks in which `fitted` wins
  std::vector<double> block_gain;
};

// Blocks are whole recordings when there are several, else stretches of 10 s. `base` lacks effect `judged` of
// `fitted`. What else happened once or lies in one place is taken as known, as no other block tells of it.
// `seed` fixes the resampling.
BlockEvidence block_evidence(const Problem& problem, Fit base, Fit fitted, std::size_t judged,
                             std::uint32_t seed);

}  // namespace atmos
