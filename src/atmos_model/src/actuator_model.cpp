#include "atmos_model/actuator_model.h"

#include <algorithm>
#include <cmath>
#include <variant>

namespace atmos {

namespace {

// Of the supply and of the thrusters' strength.
std::vector<Effect> supply_only(const std::vector<Effect>& effects) {
  std::vector<Effect> kept;
  for (const Effect& effect : effects) {
    if (std::holds_alternative<ThrustScale>(effect) || std::holds_alternative<ThrusterEfficiency>(effect) ||
        std::holds_alternative<ThrusterDead>(effect) || std::holds_alternative<SupplyCoupling>(effect) ||
        std::holds_alternative<SupplyDroop>(effect) || std::holds_alternative<PressureDecay>(effect) ||
        std::holds_alternative<MassDepletion>(effect))
      kept.push_back(effect);
  }
  return kept;
}

}  // namespace

ActuatorModel::ActuatorModel(const Vehicle& nominal, const std::vector<Effect>& effects)
    : supply_(nominal, supply_only(effects), 0.0), vehicle_(nominal) {
  const PlantProperties properties = Plant(nominal, effects, 0.0).properties();
  timing_ = properties.timing;
  for (const Effect& effect : effects) {
    if (const auto* rise = std::get_if<ThrustRise>(&effect)) rise_s_ = rise->time_constant_s;
  }
  vehicle_.mass_kg = properties.mass_kg;
  vehicle_.inertia_kg_m2.z() = properties.inertia_kg_m2;
  state_.hidden = supply_.initial_hidden();
  // Where all are open at once nobody knows what to plan with; two are what a force along one axis takes.
  constexpr std::size_t kOpen = 2;
  for (std::size_t i = 0; i < vehicle_.thrusters.size(); ++i) {
    Thruster& thruster = vehicle_.thrusters[i];
    thruster.position_m.head<2>() -= properties.com_B;
    VecX<double> openings = VecX<double>::Zero(static_cast<Eigen::Index>(vehicle_.thrusters.size()));
    openings[static_cast<Eigen::Index>(i)] = 1.0;
    for (std::size_t j = 0; openings.sum() < static_cast<double>(kOpen) && j < vehicle_.thrusters.size(); ++j)
      openings[static_cast<Eigen::Index>(j)] = 1.0;
    const bool dead = std::isfinite(timing_.dead_since_s[i]);
    thruster.force_n = dead ? 0.0
                            : std::max(0.0, supply_.thrust<double>(0.0, {}, state_.hidden,
                                                                   openings)[static_cast<Eigen::Index>(i)]);
  }
}

void ActuatorModel::observe(double time_s, const ValveSchedule& valves) {
  if (!started_) {
    state_ = {time_s, {}, supply_.initial_hidden()};
    started_ = true;
  }
  if (time_s > state_.time_s) advance(supply_, valves, time_s, state_);
}

VecX<double> ActuatorModel::mean_force(double time_s, const std::vector<double>& open) const {
  const auto n = static_cast<Eigen::Index>(open.size());
  const double period = vehicle_.pwm.period_s, lag = rise_s_ / period;
  // Level of a valve at the share `t` of the period, as ThrustRise has it.
  const auto level = [lag](double closes, double t) {
    if (lag == 0.0) return t < closes ? 1.0 : 0.0;
    return t < closes ? 1.0 - std::exp(-t / lag)
                      : (1.0 - std::exp(-closes / lag)) * std::exp(-(t - closes) / lag);
  };
  VecX<double> levels(n), mean = VecX<double>::Zero(n);
  // Gauss-Legendre of three points, exact enough where levels bend by no more than e^-2 or have settled.
  const auto integrate = [&](double from, double to) {
    constexpr double kPoints[3] = {0.5 - 0.3872983346207417, 0.5, 0.5 + 0.3872983346207417};
    constexpr double kWeights[3] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
    for (int point = 0; point < 3; ++point) {
      const double t = from + kPoints[point] * (to - from);
      for (Eigen::Index i = 0; i < n; ++i) levels[i] = level(open[static_cast<std::size_t>(i)], t);
      mean += kWeights[point] * (to - from) * supply_.thrust<double>(time_s, {}, state_.hidden, levels);
    }
  };
  // Pulses start together, so that over a period the set of open valves shrinks from edge to edge; after the
  // last one thrust dies away.
  std::vector<double> edges(open);
  edges.push_back(0.0);
  std::sort(edges.begin(), edges.end());
  edges.push_back(edges.back() + 6.0 * lag);
  for (std::size_t e = 0; e + 1 < edges.size(); ++e) {
    const double settled = std::min(edges[e] + 2.0 * lag, edges[e + 1]);
    if (settled > edges[e]) integrate(edges[e], settled);
    if (edges[e + 1] > settled) integrate(settled, edges[e + 1]);
  }
  return mean;
}

void ActuatorModel::compensate(double time_s, std::vector<double>& share) const {
  if (vehicle_.actuation == Actuation::kContinuous) return;  // no valves, no supply
  // Fixed point: what a duty lacks in mean force is added to it. Coupling takes at most a third from a
  // thruster, so that each round leaves less than two thirds of the error, and far less where few are open.
  constexpr int kMostRounds = 12;
  constexpr double kResolution = 1e-4;  // of a duty
  const double period = vehicle_.pwm.period_s;
  const double longer = (timing_.close_delay_s - timing_.open_delay_s) / period;  // than commanded
  const std::vector<double> wanted = share;
  for (int round = 0; round < kMostRounds; ++round) {
    const VecX<double> mean = mean_force(time_s, share);
    double change = 0.0;
    for (std::size_t i = 0; i < share.size(); ++i) {
      const double force = vehicle_.thrusters[i].force_n;
      const double before = share[i];
      share[i] = wanted[i] > 0.0 && force > 0.0
                     ? std::clamp(before + wanted[i] - mean[static_cast<Eigen::Index>(i)] / force, 0.0, 1.0)
                     : 0.0;
      change = std::max(change, std::abs(share[i] - before));
    }
    if (change < kResolution) break;
  }
  for (double& duty : share) {
    if (duty > 0.0 && duty < 1.0) duty = std::clamp(duty - longer, 0.0, 1.0);
    if (duty * period < vehicle_.pwm.min_on_time_s) duty = 0.0;
  }
}

}  // namespace atmos
