// Every kind of the vocabulary as a hypothesis: what is free, what is plausible, and where a search starts.
// Physics and units only; nothing here knows a data set.
#pragma once

#include <string>
#include <vector>

#include "atmos_sim2real/fit.h"

namespace atmos {

// A place from which a fit can start: an effect, and those of its parameters that a screen may solve for
// linearly there.
struct Start {
  Effect effect;
  std::vector<std::string> linear;  // empty: the effect as it stands is the column, amplitude 1
};

struct Hypothesis {
  std::string kind;
  int thruster = 0;  // 0: not about one thruster
  std::string law;   // of kind unmodelled: which one, in words
  std::vector<Start> starts;
  std::vector<FreeParameter> free;  // `effect` index to be filled in by the user
  double penalty = 0.0;  // nats for the choices that no prior width expresses: which thruster, which event
  bool map = false;      // many coefficients
  bool sure_of_a_fit = false;  // screens badly, as maps do, or as what its starts lie far from
  double onsets = 0.0;         // seconds of flight in which it may begin; 0: it is there all the time
  bool local = false;  // an event, a phase or a place: data that its fit has not seen may not know of it
};

// Whether both are about the same thing: the same kind of the same thruster, or the same law.
bool same_subject(const Hypothesis& a, const Hypothesis& b);

// Kinds that pose and command can never separate, whatever is flown (docs/effects.md): of each set the first
// is claimed. The others may be no kind alone.
const std::vector<std::vector<std::string>>& inseparable();

// All hypotheses for these flights (they fix where floor and tether grids lie), except those found in the
// innovations themselves (events, oscillations).
std::vector<Hypothesis> hypotheses(const Vehicle& vehicle, const std::vector<Flight>& flights);

}  // namespace atmos
