// Effects of a size at which they come down to a simpler kind: valves that open as late as they close are
// late commands, a thruster without thrust is dead.
#pragma once

#include <optional>
#include <vector>

#include "atmos_sim2real/screen.h"

namespace atmos {

struct SimplerForm {
  Hypothesis hypothesis;
  Fit fit;      // the simpler effect stands last
  double gain;  // nats over the form it replaces
};

// The model with effect `index`, claimed as `claimed`, in its simpler form, where it has one in the library
// that explains the flights as well. The others start from where they are: a fit without the effect would
// lead them away.
std::optional<SimplerForm> simpler_form(const Problem& problem, const Fit& current, std::size_t index,
                                        const Hypothesis& claimed, const std::vector<Hypothesis>& library);

}  // namespace atmos
