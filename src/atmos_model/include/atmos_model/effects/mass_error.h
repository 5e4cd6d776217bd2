#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The robot weighs more or less than the vehicle file says; its inertia is as stated.
struct MassError : EffectHooks {
  static constexpr const char* kKind = "mass_error";
  static constexpr const char* kEquation = "M <- factor M (I unchanged)";

  double factor = 1.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"factor", "1", Bounds::between(0.3, 3.0), "of the mass"}, self.factor);
  }

  void alter(PlantProperties& plant) const { plant.mass_kg *= factor; }
};

}  // namespace atmos
