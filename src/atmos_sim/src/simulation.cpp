#include "atmos_sim/simulation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ode_world.h"

namespace atmos {

namespace {

constexpr double kSameInstant = 1e-10;  // s
// A step may exceed the nominal one by this share rather than leave a sliver behind.
constexpr double kStretch = 1e-3;

}  // namespace

Simulation::Simulation(const Scenario& scenario, double start_s)
    : Simulation(std::vector<Scenario>{scenario}, start_s) {}

Simulation::Simulation(const std::vector<Scenario>& fleet, double start_s)
    : start_s_(start_s), time_s_(start_s) {
  if (fleet.empty()) throw std::invalid_argument("a simulation needs a robot");
  step_s_ = fleet.front().step_s;
  for (const Scenario& scenario : fleet) robots_.emplace_back(scenario, start_s);
  ode_ = std::make_unique<OdeWorld>(fleet.front().world, robots_);
  before_.resize(robots_.size());
}

Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

void Simulation::advance_to(double until_s) {
  for (std::size_t i = 0; i < robots_.size(); ++i) ode_->set_mass(i, robots_[i].mass_kg());
  while (until_s - time_s_ > kSameInstant) {
    const double grid = start_s_ + step_s_ * (std::floor((time_s_ - start_s_) / step_s_ + kStretch) + 1.0);
    const double end = until_s > grid + kStretch * step_s_ ? grid : until_s;
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      before_[i] = robots_[i].center_of_mass();
      robots_[i].move(end);
    }
    ode_->step(before_, end - time_s_, robots_);
    time_s_ = end;
  }
  for (Robot& robot : robots_) robot.forget_past();
}

std::uint64_t Simulation::steps() const {
  std::uint64_t sum = 0;
  for (const Robot& robot : robots_) sum += robot.steps();
  return sum;
}

std::uint64_t Simulation::contacts() const { return ode_->contacts(); }

}  // namespace atmos
