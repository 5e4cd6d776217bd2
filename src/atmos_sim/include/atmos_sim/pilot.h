// Flights in closed loop without ROS: a plain set-point controller in place of the NMPC.
#pragma once

#include <vector>

#include "atmos_model/scenario.h"
#include "atmos_sim/batch.h"

namespace atmos {

struct PilotGains {
  double natural_frequency_rad_s = 0.8;  // of position and yaw about the set-point
  double damping = 0.9;
  double observer_rad_s = 6.0;  // bandwidth of the velocity estimate
};

// One frame of a flight, with the motion of the measured point that it would have shown without any error.
struct PilotedRow {
  BatchRow row;
  PlanarState<double> shown;
};

struct PilotedFlight {
  std::vector<ThrusterCommand> commands;
  std::vector<PilotedRow> rows;
};

// Flies the scenario's set-points from `start_s`, which must lie on the PWM grid: a proportional-derivative
// law on what the mocap shows, without knowledge of the effects, 10 ms behind, allocated to pulses of at
// least 2 ms.
PilotedFlight fly_piloted(const Scenario& scenario, const PilotGains& gains, double start_s);

}  // namespace atmos
