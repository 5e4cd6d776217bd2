// The model's own integrator: open-loop motion of a plant under commands, exact at valve edges.
#pragma once

#include "atmos_model/plant.h"
#include "atmos_model/valve_schedule.h"

namespace atmos {

// Everything that moves, at one ROS time.
struct PlantState {
  double time_s = 0.0;
  PlanarState<double> body;
  VecX<double> hidden;
};

// Advances `state` to ROS time `until_s` with classical Runge-Kutta steps of at most `max_step_s`, stopping
// at every valve edge and every jump of an effect.
void advance(const Plant& plant, const ValveSchedule& valves, double until_s, PlantState& state,
             double max_step_s = 5e-3);

}  // namespace atmos
