// Hypotheses that no grid can list: single events and oscillations, found in the innovations themselves.
#pragma once

#include <vector>

#include "atmos_sim2real/library.h"

namespace atmos {

// Pushes from outside: matched filter for a jump of velocity on all axes, peeled off one by one. One
// hypothesis with all events whose score passes `least_gain` nats each; none: empty.
std::vector<Hypothesis> find_events(const Problem& problem, const Fit& fit, double least_gain);

// A sinusoidal force: the strongest line in the spectrum of the innovations of x and y, where it stands out
// by `least_gain` nats from white noise; one hypothesis per flight that has one, and where it is no line but
// an ellipse a law that goes round. The same for a torque.
std::vector<Hypothesis> find_oscillations(const Problem& problem, const Fit& fit, double least_gain);

// The weakest push that find_events() would have found at a typical moment [N s].
double smallest_push(const Problem& problem, const Fit& fit, double least_gain);

}  // namespace atmos
