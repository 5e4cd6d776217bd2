#include "atmos_nmpc/flight_model.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

using namespace state13;

// The effects whose kinds are named, and those that alter constants.
template <class... Kinds>
std::vector<Effect> only(const std::vector<Effect>& effects) {
  std::vector<Effect> kept;
  for (const Effect& effect : effects) {
    if ((std::holds_alternative<Kinds>(effect) || ...)) kept.push_back(effect);
  }
  return kept;
}

std::vector<Effect> external_only(const std::vector<Effect>& effects) {
  return only<ThrustScale, ThrusterEfficiency, ThrusterLeak, ThrusterMisalignment, MassError, InertiaError,
              ComOffset, FloorTilt, FloorUnevenness, Airflow, Tether, ViscousDrag, QuadraticDrag,
              CoulombFriction, FrictionPatch, Unmodelled>(effects);
}

std::vector<Effect> supply_only(const std::vector<Effect>& effects) {
  return only<ThrustScale, ThrusterEfficiency, ThrusterDead, SupplyCoupling, SupplyDroop, PressureDecay,
              MassDepletion>(effects);
}

PlanarState<double> planar(const State13<double>& x) {
  PlanarState<double> state;
  state.p_WC = x.segment<2>(kPosition);
  state.v_WC = x.segment<2>(kVelocity);
  state.yaw = 2.0 * std::atan2(x[kQuaternion + 3], x[kQuaternion]);
  state.yaw_rate = x[kAngularVelocity + 2];
  return state;
}

// `x` with its planar part replaced.
State13<double> with_planar(State13<double> x, const PlanarState<double>& state) {
  x.segment<2>(kPosition) = state.p_WC;
  x.segment<2>(kVelocity) = state.v_WC;
  x.segment<4>(kQuaternion) << std::cos(0.5 * state.yaw), 0.0, 0.0, std::sin(0.5 * state.yaw);
  x[kAngularVelocity + 2] = state.yaw_rate;
  return x;
}

// Time constant of the thrust: its force acts that much later on average.
double rise_s(const std::vector<Effect>& effects) {
  for (const Effect& effect : effects) {
    if (const auto* rise = std::get_if<ThrustRise>(&effect)) return rise->time_constant_s;
  }
  return 0.0;
}

}  // namespace

FlightModel::FlightModel(const Vehicle& nominal, const std::vector<Effect>& effects)
    : plant_(nominal, effects, 0.0),
      external_(nominal, external_only(effects), 0.0),
      supply_(nominal, supply_only(effects), 0.0),
      vehicle_(nominal),
      delay_s_(timing().command_delay_s + timing().open_delay_s + rise_s(effects)) {
  const PlantProperties& properties = plant_.properties();
  vehicle_.mass_kg = properties.mass_kg;
  vehicle_.inertia_kg_m2.z() = properties.inertia_kg_m2;
  supply_state_.hidden = supply_.initial_hidden();
  // Where all are open at once nobody knows what to plan with; two are what a force along one axis takes.
  constexpr std::size_t kOpen = 2;
  for (std::size_t i = 0; i < vehicle_.thrusters.size(); ++i) {
    Thruster& thruster = vehicle_.thrusters[i];
    thruster.position_m.head<2>() -= properties.com_B;
    VecX<double> openings = VecX<double>::Zero(static_cast<Eigen::Index>(vehicle_.thrusters.size()));
    openings[static_cast<Eigen::Index>(i)] = 1.0;
    for (std::size_t j = 0; openings.sum() < static_cast<double>(kOpen) && j < vehicle_.thrusters.size(); ++j)
      openings[static_cast<Eigen::Index>(j)] = 1.0;
    const bool dead = std::isfinite(properties.timing.dead_since_s[i]);
    thruster.force_n = dead ? 0.0
                            : std::max(0.0, supply_.thrust<double>(0.0, {}, supply_state_.hidden,
                                                                   openings)[static_cast<Eigen::Index>(i)]);
  }
}

State13<double> FlightModel::from_measured(const State13<double>& shown) const {
  return with_planar(shown, plant_.from_measured(planar(shown)));
}

State13<double> FlightModel::shown(const State13<double>& at_C) const {
  return with_planar(at_C, geometric_center_state(planar(at_C), plant_.properties().com_B));
}

ReferencePoint FlightModel::of_center_of_mass(const ReferencePoint& of_base) const {
  ReferencePoint point = of_base;
  point.x = with_planar(of_base.x, center_of_mass_state(planar(of_base.x), plant_.properties().com_B));
  return point;
}

void FlightModel::observe(double time_s, const State13<double>& at_C, const ValveSchedule& valves) {
  if (!state_) {
    state_ = PlantState{time_s, planar(at_C), plant_.initial_hidden()};
    supply_state_ = {time_s, {}, supply_.initial_hidden()};
  }
  advance(plant_, valves, time_s, *state_);
  state_->body = planar(at_C);
  advance(supply_, valves, time_s, supply_state_);
}

State13<double> FlightModel::predict(double until_s, const ValveSchedule& valves) const {
  PlantState state = *state_;
  advance(plant_, valves, until_s, state);
  return with_planar(State13<double>::Zero(), state.body);
}

Disturbance FlightModel::disturbance(double time_s, const State13<double>& at_C,
                                     const State13<double>& wanted_C) const {
  const VecX<double> closed = VecX<double>::Zero(external_.thruster_count());
  PlanarState<double> at = planar(at_C);
  const PlanarState<double> wanted = planar(wanted_C);
  at.v_WC = wanted.v_WC;
  at.yaw_rate = wanted.yaw_rate;
  const PlanarWrench<double> wrench =
      external_.wrench<double>(time_s, at, external_.initial_hidden(), closed);
  Disturbance disturbance;
  disturbance.acceleration_W.head<2>() = wrench.force_W / vehicle_.mass_kg;
  disturbance.angular_acceleration_B[2] = wrench.torque / vehicle_.inertia_kg_m2.z();
  return disturbance;
}

void FlightModel::compensate(double time_s, std::vector<double>& share) const {
  // Pulses start together, so that over a period the set of open valves shrinks from edge to edge. Fixed
  // point: what a duty lacks in mean force is added to it. Coupling takes at most a third from a thruster,
  // so that each round leaves less than two thirds of the error, and far less where few are open.
  constexpr int kRounds = 12;
  const auto n = static_cast<Eigen::Index>(share.size());
  const double period = vehicle_.pwm.period_s;
  const double longer = (timing().close_delay_s - timing().open_delay_s) / period;  // than commanded
  const std::vector<double> wanted = share;
  VecX<double> openings(n), mean(n);
  std::vector<double> edges;
  for (int round = 0; round < kRounds; ++round) {
    edges.assign(share.begin(), share.end());
    edges.push_back(0.0);
    std::sort(edges.begin(), edges.end());
    mean.setZero();
    for (std::size_t e = 0; e + 1 < edges.size(); ++e) {
      const double length = edges[e + 1] - edges[e];
      if (length <= 0.0) continue;
      for (Eigen::Index i = 0; i < n; ++i)
        openings[i] = share[static_cast<std::size_t>(i)] > edges[e] ? 1.0 : 0.0;
      mean += length * supply_.thrust<double>(time_s, {}, supply_state_.hidden, openings);
    }
    for (std::size_t i = 0; i < share.size(); ++i) {
      const double force = vehicle_.thrusters[i].force_n;
      if (wanted[i] <= 0.0 || force <= 0.0) {
        share[i] = 0.0;
        continue;
      }
      share[i] = std::clamp(share[i] + wanted[i] - mean[static_cast<Eigen::Index>(i)] / force, 0.0, 1.0);
    }
  }
  for (double& duty : share) {
    if (duty > 0.0 && duty < 1.0) duty = std::clamp(duty - longer, 0.0, 1.0);
    if (duty * period < vehicle_.pwm.min_on_time_s) duty = 0.0;
  }
}

}  // namespace atmos
