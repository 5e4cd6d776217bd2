#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The yaw inertia differs from the vehicle file.
struct InertiaError : EffectHooks {
  static constexpr const char* kKind = "inertia_error";
  static constexpr const char* kEquation = "I <- factor I";

  double factor = 1.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"factor", "1", Bounds::between(0.2, 5.0), "of the yaw inertia"}, self.factor);
  }

  void alter(PlantProperties& plant) const { plant.inertia_kg_m2 *= factor; }
};

}  // namespace atmos
