#include "atmos_sim/robot.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace atmos {

namespace {

// Instants closer than this are one: a step that short would only add rounding.
constexpr double kSameInstant = 1e-10;  // s
// A step may exceed the longest one by this share rather than leave a sliver behind.
constexpr double kStretch = 1e-3;

PlanarState<double> start_state(const Scenario& scenario, const Plant& plant) {
  PlanarState<double> at_O;
  at_O.p_WC = {scenario.start.x_m, scenario.start.y_m};
  at_O.yaw = scenario.start.yaw_rad;
  return center_of_mass_state(at_O, plant.properties().com_B);
}

// `from` after `dt` with the velocity of `moving` and an acceleration.
PlanarState<double> advanced(const PlanarState<double>& from, const PlanarState<double>& moving,
                             const PlanarAcceleration<double>& acceleration, double dt) {
  return {from.p_WC + dt * moving.v_WC, from.yaw + dt * moving.yaw_rate, from.v_WC + dt * acceleration.a_WC,
          from.yaw_rate + dt * acceleration.yaw_acceleration};
}

// Cubic through positions and velocities at both ends; s in [0, 1] over `dt`.
template <class T>
T hermite(const T& p0, const T& v0, const T& p1, const T& v1, double s, double dt) {
  const double s2 = s * s, s3 = s2 * s;
  return (2 * s3 - 3 * s2 + 1) * p0 + (s3 - 2 * s2 + s) * dt * v0 + (3 * s2 - 2 * s3) * p1 +
         (s3 - s2) * dt * v1;
}

}  // namespace

Robot::Robot(const Scenario& scenario, double start_s)
    : vehicle_(scenario.vehicle),
      supply_(scenario.pneumatics),
      plant_(scenario.vehicle, scenario.effects, start_s),
      valves_(plant_.thruster_count(), plant_.properties().timing, plant_.properties().actuation),
      lab_(scenario.lab, scenario.seed, start_s, plant_.thruster_count()),
      time_s_(start_s),
      body_(start_state(scenario, plant_)),
      hidden_(plant_.initial_hidden()),
      openings_(plant_.thruster_count()) {
  if (supply_ && !supply_->tethered && vehicle_.pneumatics)
    usable_air_kg_ = read_air(*vehicle_.pneumatics, *supply_, 0.0).gas_remaining_kg;
  if (vehicle_.battery) battery_.emplace(*vehicle_.battery);
  remember();
}

ValveSchedule::Taken Robot::command(const ThrusterCommand& command) {
  valve_edge_s_ = -std::numeric_limits<double>::infinity();
  return valves_.add(command, time_s_);
}

VecX<double> Robot::openings() const {
  VecX<double> openings = VecX<double>::Zero(plant_.thruster_count());
  if (actuated()) valves_.openings(time_s_ + kSameInstant, openings.data());
  return openings;
}

// Bearings down and valves shut from now on; propellers turn on.
void Robot::lose_air() {
  has_air_ = false;
  if (!actuated()) {
    openings_.setZero();
    lab_.valves_moved(openings_);
  }
  // A bearing that is down has no hidden state: those of the other effects keep their places.
  std::vector<Effect> effects = plant_.effects();
  for (int bearing = 1; bearing <= static_cast<int>(vehicle_.bearings_m.size()); ++bearing)
    effects.push_back(BearingDown{{}, bearing, time_s_, vehicle_.pneumatics->rubbing_friction});
  vehicle_.pneumatics->bearing_flow_kg_s = 0.0;
  plant_ = Plant(vehicle_, std::move(effects), plant_.start_s());
}

void Robot::move(double until_s) {
  if (has_air_ && hidden_[0] >= usable_air_kg_) lose_air();
  const std::vector<double>& jumps = plant_.edges();
  double activity = 0.0;
  const double from_s = time_s_;
  while (until_s - time_s_ > kSameInstant) {
    const double past_now = time_s_ + kSameInstant;
    if (actuated() && valve_edge_s_ <= past_now) {
      valves_.openings(past_now, openings_.data());
      valve_edge_s_ = valves_.next_edge(past_now);
      lab_.valves_moved(openings_);
    }
    double end = actuated() ? std::min(until_s, valve_edge_s_) : until_s;
    const auto jump = std::upper_bound(jumps.begin(), jumps.end(), past_now);
    if (jump != jumps.end()) end = std::min(end, *jump);
    if (end - time_s_ > (1.0 + kStretch) * plant_.max_step_s()) end = time_s_ + plant_.max_step_s();
    if (battery_) {
      const bool propellers = vehicle_.actuation == Actuation::kContinuous;
      activity += (end - time_s_) *
                  (propellers ? openings_.cwiseAbs().array().pow(1.5).sum() : openings_.cwiseAbs().sum());
    }
    step(end - time_s_);
    time_s_ = end;
  }
  if (battery_ && time_s_ > from_s) battery_->draw(activity / (time_s_ - from_s), time_s_ - from_s);
}

// Heun's rule of third order: it never asks for the end of the step, where forces may jump. Of third order
// because thrusts that rise multiply each other in the supply coupling, which the midpoint rule gets wrong
// always to the same side.
void Robot::step(double dt) {
  // Just after the start, in case a jump lies there.
  plant_.rate(time_s_ + kSameInstant, body_, hidden_, openings_, rate_[0]);
  PlanarState<double> stage = advanced(body_, body_, rate_[0].body, dt / 3.0);
  hidden_stage_ = hidden_ + dt / 3.0 * rate_[0].hidden;
  plant_.rate(time_s_ + dt / 3.0, stage, hidden_stage_, openings_, rate_[1]);
  stage = advanced(body_, stage, rate_[1].body, 2.0 * dt / 3.0);
  hidden_stage_ = hidden_ + 2.0 * dt / 3.0 * rate_[1].hidden;
  plant_.rate(time_s_ + 2.0 * dt / 3.0, stage, hidden_stage_, openings_, rate_[1]);

  hidden_ += dt * (0.25 * rate_[0].hidden + 0.75 * rate_[1].hidden);
  PlanarAcceleration<double> mean{
      0.25 * rate_[0].body.a_WC + 0.75 * rate_[1].body.a_WC,
      0.25 * rate_[0].body.yaw_acceleration + 0.75 * rate_[1].body.yaw_acceleration};
  if (!lab_.quiet()) {
    const VecX<double> thrust = plant_.thrust<double>(time_s_ + kSameInstant, body_, hidden_, openings_);
    const PlanarWrench<double> extra = lab_.wrench(time_s_, plant_.properties(), body_.yaw, thrust);
    mean.a_WC += extra.force_W / plant_.mass<double>(time_s_, body_, hidden_);
    mean.yaw_acceleration += extra.torque / plant_.properties().inertia_kg_m2;
  }
  // Exact under a constant force.
  body_.p_WC += dt * (body_.v_WC + 0.5 * dt * mean.a_WC);
  body_.yaw += dt * (body_.yaw_rate + 0.5 * dt * mean.yaw_acceleration);
  body_.v_WC += dt * mean.a_WC;
  body_.yaw_rate += dt * mean.yaw_acceleration;
  ++steps_;
}

void Robot::settle(const PlanarState<double>& body) {
  body_ = body;
  remember();
}

void Robot::set_body(const PlanarState<double>& center_of_mass) {
  past_.clear();
  settle(center_of_mass);
}

void Robot::remember() {
  const double oldest = time_s_ - plant_.properties().mocap_latency_s;
  past_.push_back({time_s_, body_});
  while (past_.size() > 2 && past_[1].time_s <= oldest) past_.pop_front();
}

PlanarState<double> Robot::center_of_mass_at(double t) const {
  assert(t <= time_s_ + kSameInstant);
  const auto after = std::lower_bound(past_.begin(), past_.end(), t - kSameInstant,
                                      [](const Past& past, double time) { return past.time_s < time; });
  if (after == past_.end()) return body_;
  if (after == past_.begin() || after->time_s - t < kSameInstant) return after->body;
  const Past& a = *std::prev(after);
  const Past& b = *after;
  const double dt = b.time_s - a.time_s;
  const double s = (t - a.time_s) / dt;
  PlanarState<double> state;
  state.p_WC = hermite(a.body.p_WC, a.body.v_WC, b.body.p_WC, b.body.v_WC, s, dt);
  state.yaw = hermite(a.body.yaw, a.body.yaw_rate, b.body.yaw, b.body.yaw_rate, s, dt);
  state.v_WC = (1.0 - s) * a.body.v_WC + s * b.body.v_WC;
  state.yaw_rate = (1.0 - s) * a.body.yaw_rate + s * b.body.yaw_rate;
  return state;
}

std::optional<AirReading> Robot::air() const {
  if (!vehicle_.pneumatics) return std::nullopt;
  const SupplySettings full{vehicle_.pneumatics->bottles, false};
  AirReading air = read_air(*vehicle_.pneumatics, supply_.value_or(full), hidden_[0]);
  if (!supply_) air.operable = true;
  return air;
}

double Robot::air_flow_kg_s() const {
  if (!has_air_ || vehicle_.actuation == Actuation::kContinuous) return plant_.properties().bearing_flow_kg_s;
  const bool tethered = supply_ && supply_->tethered;
  const double each =
      tethered ? MassDepletion{}.kg_per_open_second : plant_.properties().gas_kg_per_open_second;
  return each * openings().sum() + plant_.properties().bearing_flow_kg_s;
}

std::optional<BatteryReading> Robot::battery() const {
  if (!battery_) return std::nullopt;
  return battery_->reading();
}

}  // namespace atmos
