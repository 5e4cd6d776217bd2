// One simulated robot by itself: its plant under its valves, free of contacts.
#pragma once

#include <deque>
#include <limits>
#include <optional>

#include "atmos_model/plant.h"
#include "atmos_model/scenario.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_sim/air_supply.h"
#include "atmos_sim/battery_pack.h"
#include "atmos_sim/lab.h"

namespace atmos {

// Times are ROS seconds. Identical inputs give bit-identical motion.
class Robot {
 public:
  // At rest at the scenario's start pose (geometric centre) at `start_s`, which is t0 of the effects.
  Robot(const Scenario& scenario, double start_s);

  // Hands a command to the valves at the present time; a late one acts only for the rest of its period.
  ValveSchedule::Taken command(const ThrusterCommand& command);
  // Moves on freely to `until_s`, a simulator's step later, in one step or more: split exactly where a valve
  // moves or a force jumps.
  void move(double until_s);
  // Puts the robot where contacts have brought it at the present time, and remembers it.
  void settle(const PlanarState<double>& body);
  // Puts the centre of mass into a state, now; hidden states and valves stay as they are.
  void set_body(const PlanarState<double>& center_of_mass);
  // Drops commands that are over.
  void forget_past() { valves_.forget_before(time_s_); }

  double time_s() const { return time_s_; }
  std::uint64_t steps() const { return steps_; }
  const Plant& plant() const { return plant_; }
  const Vehicle& vehicle() const { return vehicle_; }
  double mass_kg() const { return plant_.mass<double>(time_s_, body_, hidden_); }
  // Motion of the geometric centre, and of the centre of mass.
  PlanarState<double> truth() const { return geometric_center_state(body_, plant_.properties().com_B); }
  const PlanarState<double>& center_of_mass() const { return body_; }
  // The centre of mass at a past instant, no longer ago than the plant's mocap latency; before the start, at
  // rest there.
  PlanarState<double> center_of_mass_at(double t) const;
  const VecX<double>& hidden() const { return hidden_; }
  // Opening and thrust [N] of every valve now.
  VecX<double> openings() const;
  VecX<double> thrust() const { return plant_.thrust<double>(time_s_, body_, hidden_, openings()); }
  // Air on board; nothing for a vehicle without pneumatics. Unlimited where the scenario sets no supply.
  std::optional<AirReading> air() const;
  // Air that flows now [kg/s], through valves and bearings, whether out of bottles or a hose.
  double air_flow_kg_s() const;
  // Nothing for a vehicle without a battery.
  std::optional<BatteryReading> battery() const;

 private:
  struct Past {
    double time_s;
    PlanarState<double> body;
  };

  void step(double dt);
  void lose_air();
  // Thrusters need air, propellers do not.
  bool actuated() const { return has_air_ || vehicle_.actuation == Actuation::kContinuous; }
  void remember();

  Vehicle vehicle_;
  std::optional<SupplySettings> supply_;
  Plant plant_;
  ValveSchedule valves_;
  Lab lab_;
  double time_s_;
  PlanarState<double> body_;
  VecX<double> hidden_;
  double usable_air_kg_ = std::numeric_limits<double>::infinity();
  bool has_air_ = true;
  std::optional<BatteryPack> battery_;
  // Openings until the next valve edge; storage of a step, kept to allocate nothing.
  double valve_edge_s_ = -std::numeric_limits<double>::infinity();
  VecX<double> openings_, hidden_stage_;
  PlantRate<double> rate_[2];
  std::deque<Past> past_;  // covers the mocap latency
  std::uint64_t steps_ = 0;
};

}  // namespace atmos
