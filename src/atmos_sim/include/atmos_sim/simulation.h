// Robots in an ODE world: rigid bodies that slide on the floor, each under its plant's force law, and bump
// into each other, walls and obstacles.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "atmos_model/scenario.h"
#include "atmos_sim/robot.h"

namespace atmos {

class OdeWorld;

// One flight. Times are ROS seconds. Identical inputs give bit-identical motion. Instances are independent of
// each other; each is used by the thread that made it.
class Simulation {
 public:
  // One robot, or those of a fleet, which share step and world. They rest at their start poses at `start_s`.
  // Throws std::invalid_argument for a fleet of none.
  Simulation(const Scenario& scenario, double start_s);
  Simulation(const std::vector<Scenario>& fleet, double start_s);
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  // Moves on to `until_s` in steps of at most the scenario's step_s. Does nothing when `until_s` has passed.
  // Throws std::runtime_error when ODE reports a fault.
  void advance_to(double until_s);

  double time_s() const { return time_s_; }
  // Of all robots together.
  std::uint64_t steps() const;
  // Contact points found so far, each counted once per step.
  std::uint64_t contacts() const;

  std::size_t size() const { return robots_.size(); }
  Robot& robot(std::size_t i = 0) { return robots_.at(i); }
  const Robot& robot(std::size_t i = 0) const { return robots_.at(i); }

 private:
  double start_s_;
  double step_s_;
  double time_s_;
  std::vector<Robot> robots_;
  std::unique_ptr<OdeWorld> ode_;
  std::vector<PlanarState<double>> before_;  // storage of a step
};

}  // namespace atmos
