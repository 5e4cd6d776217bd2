#include "atmos_model/plant.h"

#include <algorithm>
#include <limits>
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
  properties_.bearings_m = vehicle.bearings_m;
  properties_.timing.dead_since_s.assign(vehicle.thrusters.size(), std::numeric_limits<double>::infinity());

  std::stable_sort(effects_.begin(), effects_.end(),
                   [](const Effect& a, const Effect& b) { return a.index() < b.index(); });
  for (Effect& effect : effects_) {
    std::visit(
        [&](auto& e) {
          if constexpr (std::is_same_v<std::decay_t<decltype(e)>, Unmodelled>)
            e.prepare(properties_.thrusters.size());
          max_step_s_ = std::min(max_step_s_, e.time_scale());
          has_floor_ = has_floor_ || e.kIsFloor;
          e.alter(properties_);
          hidden_size_ += e.hidden_size(properties_);
          e.edges(edges_);
        },
        effect);
  }
  std::sort(edges_.begin(), edges_.end());
}

VecX<double> Plant::initial_hidden() const {
  VecX<double> hidden = VecX<double>::Zero(hidden_size_);
  for_each(hidden.data(), [](const auto& e, double* own) { e.start_hidden(own); });
  return hidden;
}

}  // namespace atmos
