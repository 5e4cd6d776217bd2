// Placebo checks: an effect that explains a recording must not explain it as well with the commands in random
// order, or from another thruster.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "atmos_sim2real/fit.h"

namespace atmos {

// Nats by which an effect, in its best strength and everything else held, raises the likelihood.
struct Placebo {
  double as_claimed = 0.0;
  std::optional<double> shuffled_commands;  // the largest of a few; none: it does not depend on commands
  std::optional<double> wrong_thruster;     // of all others the best; none: it is no thruster's
  int best_wrong_thruster = 0;
};

// Per effect of a fit.
std::vector<Placebo> placebo_checks(const Problem& problem, const Fit& final, std::uint32_t seed);

}  // namespace atmos
