// Hypotheses that no grid can list: single events and oscillations, found in the innovations themselves.
#pragma once

#include <optional>
#include <vector>

#include "atmos_sim2real/library.h"

namespace atmos {

// Pushes from outside: matched filter for a jump of velocity on all axes, peeled off one by one. One
// hypothesis with all events whose score passes `least_gain` nats each; none: empty.
std::vector<Hypothesis> find_events(const Problem& problem, const Fit& fit, double least_gain);

// A model that has pushes, effect `index`, with those that show themselves beside all that it knows by now,
// and without those that are no longer worth `least_gain` nats each, down to one; none where nothing changes.
// The motion is not smoothed again.
std::optional<Fit> with_pushes_again(const Problem& problem, const Fit& current, std::size_t index,
                                     double least_gain);

// A sinusoidal force: the strongest line in the spectrum of the innovations of x and y, where it stands out
// by `least_gain` nats from white noise; one hypothesis per flight that has one, and where it is no line but
// an ellipse a law that goes round. The same for a torque.
std::vector<Hypothesis> find_oscillations(const Problem& problem, const Fit& fit, double least_gain);

// The weakest push that find_events() would have found at a typical moment [N s].
double smallest_push(const Problem& problem, const Fit& fit, double least_gain);

}  // namespace atmos
