// What to fly next where recordings cannot decide between two explanations: set-point flights that any
// controller of the robot can fly, and what each would tell.
#pragma once

#include <string>
#include <vector>

#include "atmos_sim2real/search.h"

namespace atmos {

struct Setpoint {
  double time_s, x_m, y_m, yaw_deg;
};

struct Manoeuvre {
  std::string description;
  std::vector<Setpoint> setpoints;
  double duration_s;
};

// Over the floor that was visited, or 1 m x 1 m around its middle where that is less.
std::vector<Manoeuvre> manoeuvres(const Box& visited);

// As a file that the set-point player flies (docs/architecture.md): a list `setpoints`.
std::string setpoint_file(const Manoeuvre& manoeuvre);

// Nats by which one flight of a robot for which `claimed` holds tells it from a rival: log likelihood of
// `claimed` as it is over that of the rival's model with the rival's own parameters fitted anew. Smooths the
// flight.
double separation(const Problem& problem, const Fit& claimed, const Tried& rival);

}  // namespace atmos
