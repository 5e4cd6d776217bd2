#include "atmos_nmpc/flight_model.h"

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

}  // namespace

FlightModel::FlightModel(const Vehicle& nominal, const std::vector<Effect>& effects)
    : plant_(nominal, effects, 0.0),
      external_(nominal, external_only(effects), 0.0),
      actuators_(nominal, effects),
      delay_s_(timing().command_delay_s + timing().open_delay_s + actuators_.rise_s()) {}

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
  }
  advance(plant_, valves, time_s, *state_);
  state_->body = planar(at_C);
  actuators_.observe(time_s, valves);
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
  disturbance.acceleration_W.head<2>() = wrench.force_W / vehicle().mass_kg;
  disturbance.angular_acceleration_B[2] = wrench.torque / vehicle().inertia_kg_m2.z();
  return disturbance;
}

}  // namespace atmos
