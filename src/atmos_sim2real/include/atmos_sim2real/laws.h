// Physics outside the vocabulary: laws in physical units over place, attitude, velocity, time and commands,
// tried as hypotheses like any other, at a price.
#pragma once

#include <vector>

#include "atmos_sim2real/library.h"

namespace atmos {

// One hypothesis of kind `unmodelled` per law; each is linear in its coefficients, but for places, lengths,
// times, exponents and frequencies.
std::vector<Hypothesis> laws(const Vehicle& vehicle, const std::vector<Flight>& flights);

// A frequency that stands out of the innovations of a flight.
struct Line {
  double frequency_hz;
  double choices;  // frequencies at which it could have been
  double duration_s;
};

// A torque of one frequency; a force of one frequency that does not swing along a line, as floor_vibration
// does.
Hypothesis swinging_torque(const Line& line);
Hypothesis circling_force(const Line& line);

// Whether a law's formulas read an opening.
bool depends_on_valves(const Unmodelled& law);
// Whether it is no oscillation either.
bool changes_slowly(const Unmodelled& law);

// Both laws as one effect: a model holds `unmodelled` once. The coefficients of the second are renamed and
// come after those of the first.
Unmodelled joined(const Unmodelled& first, const Unmodelled& second);

}  // namespace atmos
