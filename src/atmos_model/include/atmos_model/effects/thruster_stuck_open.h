#pragma once

#include <algorithm>

#include "atmos_model/effect.h"

namespace atmos {

// A valve that no longer closes: it counts as open and in the gas used. A dead valve stays shut.
struct ThrusterStuckOpen : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "thruster_stuck_open";
  static constexpr const char* kEquation = "o_k = 1 for t >= since_s";

  int thruster = 1;
  double since_s = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(thruster_number(), self.thruster);
    visit(since(), self.since_s);
  }

  void alter(PlantProperties& plant) const {
    double& stuck = plant.timing.stuck_open_since_s.at(static_cast<std::size_t>(thruster - 1));
    stuck = std::min(stuck, since_s);
  }
};

}  // namespace atmos
