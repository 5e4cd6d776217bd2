// What a model.yaml says of the thrust behind a duty, for whoever makes duties of forces: the controller at
// thruster level, the flight controller below it.
#pragma once

#include <vector>

#include "atmos_model/plant.h"
#include "atmos_model/predictor.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"

namespace atmos {

// Times are ROS seconds.
class ActuatorModel {
 public:
  // Throws std::invalid_argument for an effect that does not fit the vehicle (Plant).
  ActuatorModel(const Vehicle& nominal, const std::vector<Effect>& effects);

  // The vehicle to allocate for: mass, inertia, thrusters about the centre of mass, each with the force it
  // has while a second one is open; dead ones have none.
  const Vehicle& vehicle() const { return vehicle_; }
  // When what is commanded really moves valves.
  const ValveTiming& timing() const { return timing_; }
  // Time constant of the thrust: its force acts that much later on average.
  double rise_s() const { return rise_s_; }

  // What is not seen of the supply (plenum, gas) is carried along by the openings up to `time_s`; an earlier
  // time than the one before changes nothing. `valves` knows timing().
  void observe(double time_s, const ValveSchedule& valves);
  // The next observe() starts anew, with a full supply.
  void forget() { started_ = false; }

  // Duties under which each thruster's mean force over a period is `share` of its force in vehicle(), with
  // what the supply takes from thrusters that are open at once while thrust rises and falls; propellers'
  // stay. In place.
  void compensate(double time_s, std::vector<double>& share) const;

 private:
  // Of each thruster, as a share of a period, when its valve is open for the share open[i] from the start on.
  VecX<double> mean_force(double time_s, const std::vector<double>& open) const;

  Plant supply_;  // constants and supply, thrust without rise
  ValveTiming timing_;
  double rise_s_ = 0.0;
  Vehicle vehicle_;
  bool started_ = false;
  PlantState state_;  // only its hidden part moves
};

}  // namespace atmos
