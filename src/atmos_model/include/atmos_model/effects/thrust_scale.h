#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Every thruster pushes harder or softer than the vehicle file says.
struct ThrustScale : EffectHooks {
  static constexpr const char* kKind = "thrust_scale";
  static constexpr const char* kEquation = "F_i <- factor F_i for every i";

  double factor = 1.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"factor", "1", Bounds::between(0.1, 3.0), "of every thruster's force"}, self.factor);
  }

  void alter(PlantProperties& plant) const {
    for (PlanarThruster& thruster : plant.thrusters) thruster.force_n *= factor;
  }
};

}  // namespace atmos
