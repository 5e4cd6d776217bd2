#pragma once

#include <algorithm>

#include "atmos_model/effect.h"

namespace atmos {

// A valve stays shut: it counts neither as open nor in the gas used.
struct ThrusterDead : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "thruster_dead";
  static constexpr const char* kEquation = "o_k = 0 for t >= since_s";

  int thruster = 1;
  double since_s = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(thruster_number(), self.thruster);
    visit(since(), self.since_s);
  }

  void alter(PlantProperties& plant) const {
    double& dead = plant.timing.dead_since_s.at(static_cast<std::size_t>(thruster - 1));
    dead = std::min(dead, since_s);
  }
};

}  // namespace atmos
