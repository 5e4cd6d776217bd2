#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// One thruster is weak (or strong).
struct ThrusterEfficiency : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "thruster_efficiency";
  static constexpr const char* kEquation = "F_k <- factor F_k for k = thruster";

  int thruster = 1;
  double factor = 1.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(thruster_number(), self.thruster);
    visit(ParameterInfo{"factor", "1", Bounds::between(0.0, 2.0), "of this thruster's force"}, self.factor);
  }

  void alter(PlantProperties& plant) const { plant.thruster(thruster).force_n *= factor; }
};

}  // namespace atmos
