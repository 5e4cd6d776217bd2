// What a model.yaml changes for the controller (docs/nmpc.md). Every law is atmos_model's own:
// constants as Plant has them, motion by advance(), thrust by Plant::thrust.
#pragma once

#include <optional>
#include <vector>

#include "atmos_model/actuator_model.h"
#include "atmos_model/plant.h"
#include "atmos_model/predictor.h"
#include "atmos_model/rigid_body.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_nmpc/rigid_body_step.h"
#include "atmos_nmpc/trajectory.h"

namespace atmos {

// Times are ROS seconds. The controller plans the motion of the centre of mass; odometry and references are
// those of base_link.
class FlightModel {
 public:
  FlightModel(const Vehicle& nominal, const std::vector<Effect>& effects);

  // The vehicle to plan with (ActuatorModel).
  const Vehicle& vehicle() const { return actuators_.vehicle(); }
  // When what is commanded really moves valves.
  const ValveTiming& timing() const { return plant_.properties().timing; }
  // From the stamp of a command until its force acts.
  double delay_s() const { return delay_s_; }
  // Age of a pose at its stamp.
  double latency_s() const { return plant_.properties().mocap_latency_s; }

  // The centre of mass's motion behind odometry, and the other way round for what the controller shows.
  State13<double> from_measured(const State13<double>& shown) const;
  State13<double> shown(const State13<double>& at_C) const;
  // The reference of the centre of mass that brings base_link to `of_base`.
  ReferencePoint of_center_of_mass(const ReferencePoint& of_base) const;

  // Takes the motion at `time_s`, no earlier than the one before; what is not seen (plenum, gas, thrust that
  // still rises, slosh) is carried along by the commands. `valves` knows timing().
  void observe(double time_s, const State13<double>& at_C, const ValveSchedule& valves);
  // The newest motion carried on to `until_s`.
  State13<double> predict(double until_s, const ValveSchedule& valves) const;
  // The next observe() starts anew.
  void forget() {
    state_.reset();
    actuators_.forget();
  }

  // Accelerations by everything but thrusters at the place `at_C`: floor, draught, tether, leaks, and the
  // friction and drag of the motion that is wanted there. Those of the measured motion are left to the
  // feedback: a plan that pays for them in advance would push along with every error of the velocity.
  Disturbance disturbance(double time_s, const State13<double>& at_C, const State13<double>& wanted_C) const;

  // ActuatorModel's.
  void compensate(double time_s, std::vector<double>& share) const { actuators_.compensate(time_s, share); }

 private:
  Plant plant_;     // everything
  Plant external_;  // what pushes with closed valves
  ActuatorModel actuators_;
  double delay_s_;
  std::optional<PlantState> state_;
};

}  // namespace atmos
