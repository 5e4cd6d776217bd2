#include "atmos_model/plant.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

namespace atmos {

Plant::Plant(const Vehicle& vehicle, std::vector<Effect> effects, double start_s)
    : effects_(std::move(effects)), start_s_(start_s) {
  properties_.mass_kg = vehicle.mass_kg;
  properties_.inertia_kg_m2 = vehicle.inertia_kg_m2.z();
  for (const Thruster& thruster : vehicle.thrusters) {
    properties_.thrusters.push_back(
        {thruster.position_m.head<2>(), thruster.direction.head<2>(), thruster.force_n});
  }
  if (properties_.thrusters.size() > static_cast<std::size_t>(kMaxThrusters))
    throw std::invalid_argument("a vehicle has at most " + std::to_string(kMaxThrusters) + " thrusters");
  properties_.bearings_m = vehicle.bearings_m;
  constexpr double kNever = std::numeric_limits<double>::infinity();
  properties_.timing.dead_since_s.assign(vehicle.thrusters.size(), kNever);
  properties_.timing.stuck_open_since_s.assign(vehicle.thrusters.size(), kNever);
  if (vehicle.pneumatics) properties_.bearing_flow_kg_s = vehicle.pneumatics->bearing_flow_kg_s;
  properties_.actuation = vehicle.actuation;
  if (vehicle.actuation == Actuation::kContinuous) {
    const auto is_rise = [](const Effect& effect) { return std::holds_alternative<ThrustRise>(effect); };
    if (vehicle.motor_time_constant_s > 0.0 && std::none_of(effects_.begin(), effects_.end(), is_rise))
      effects_.push_back(ThrustRise{{}, vehicle.motor_time_constant_s});
  }

  std::stable_sort(effects_.begin(), effects_.end(),
                   [](const Effect& a, const Effect& b) { return a.index() < b.index(); });
  for (Effect& effect : effects_) {
    if (const std::string unfit = misfit(effect, vehicle); !unfit.empty())
      throw std::invalid_argument(kind_of(effect) + ": " + unfit);
    std::visit(
        [&](auto& e) {
          if constexpr (std::is_same_v<std::decay_t<decltype(e)>, Unmodelled>)
            e.prepare(properties_.thrusters.size());
          max_step_s_ = std::min(max_step_s_, e.time_scale());
          e.alter(properties_);
          e.edges(edges_);
        },
        effect);
  }
  if (vehicle.actuation == Actuation::kContinuous) properties_.gas_kg_per_open_second = 0.0;
  std::sort(edges_.begin(), edges_.end());
  list_hooks();
}

namespace {

// Whether a kind hides a hook of EffectHooks with its own: then the pointer belongs to another class.
template <class Own, class Inherited>
constexpr bool hides(Own, Inherited) {
  return !std::is_same_v<Own, Inherited>;
}

using SlopeAt = Vec2<double> (*)(const Vec2<double>&);  // any type will do to name the hook

}  // namespace

void Plant::list_hooks() {
  for (std::size_t i = 0; i < effects_.size(); ++i) {
    const Slot slot{i, hidden_size_};
    std::visit(
        [&](const auto& e) {
          using E = std::decay_t<decltype(e)>;
          using H = EffectHooks;
          if (hides(&E::template rise<double>, &H::rise<double>)) rises_.push_back(slot);
          if (hides(&E::template mass<double>, &H::mass<double>)) masses_.push_back(slot);
          if (hides(&E::template thrust<double>, &H::thrust<double>)) thrusts_.push_back(slot);
          if (hides(&E::template force<double>, &H::force<double>)) forces_.push_back(slot);
          if (hides(&E::template slope<double>, &H::slope<double>)) floors_.push_back(slot);
          if (hides(&E::template hidden_rate<double, SlopeAt>, &H::hidden_rate<double, SlopeAt>))
            hidden_rates_.push_back(slot);
          hidden_size_ += e.hidden_size(properties_);
        },
        effects_[i]);
  }
}

VecX<double> Plant::initial_hidden() const {
  VecX<double> hidden = VecX<double>::Zero(hidden_size_);
  int at = 1;
  for (const Effect& effect : effects_) {
    std::visit(
        [&](const auto& e) {
          e.start_hidden(hidden.data() + at);
          at += e.hidden_size(properties_);
        },
        effect);
  }
  return hidden;
}

}  // namespace atmos
