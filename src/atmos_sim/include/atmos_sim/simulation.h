// The robot in an ODE world: a rigid body that slides on the floor under the plant's force law.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <memory>

#include "atmos_model/plant.h"
#include "atmos_model/scenario.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_sim/lab.h"

namespace atmos {

// One flight of a scenario's vehicle. Times are ROS seconds. Identical inputs give bit-identical motion.
// Instances are independent of each other; each is used by the thread that made it.
class Simulation {
 public:
  // The robot rests at the scenario's start pose (geometric centre) at `start_s`, which is t0 of the effects.
  Simulation(const Scenario& scenario, double start_s);
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  // Hands a command to the valves at the present time; a late one acts only for the rest of its period.
  ValveSchedule::Taken command(const ThrusterCommand& command) {
    valve_edge_s_ = -std::numeric_limits<double>::infinity();
    return valves_.add(command, time_s_);
  }
  // Moves on to `until_s` in steps of at most the scenario's step_s, split exactly where a valve moves or a
  // force jumps. Does nothing when `until_s` has passed. Throws std::runtime_error when ODE reports a fault.
  void advance_to(double until_s);

  // Puts the centre of mass into a state, now; hidden states and valves stay as they are.
  void set_body(const PlanarState<double>& center_of_mass);

  double time_s() const { return time_s_; }
  std::uint64_t steps() const { return steps_; }
  const Plant& plant() const { return plant_; }
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

 private:
  class OdeBody;
  struct Past {
    double time_s;
    PlanarState<double> body;
  };

  void step(double dt);
  void remember();

  Plant plant_;
  ValveSchedule valves_;
  double start_s_;
  double step_s_;
  double time_s_;
  PlanarState<double> body_;
  VecX<double> hidden_;
  Lab lab_;
  // Openings until the next valve edge; storage of a step, kept to allocate nothing.
  double valve_edge_s_ = -std::numeric_limits<double>::infinity();
  VecX<double> openings_, hidden_stage_;
  PlantRate<double> rate_[2];
  std::unique_ptr<OdeBody> ode_;
  std::deque<Past> past_;  // covers the mocap latency
  std::uint64_t steps_ = 0;
};

}  // namespace atmos
