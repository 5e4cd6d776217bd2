#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The gas that leaves makes the robot lighter.
struct MassDepletion : EffectHooks {
  static constexpr const char* kKind = "mass_depletion";
  static constexpr const char* kEquation = "M <- M - g, dg/dt = kg_per_open_second n; I unchanged";

  double kg_per_open_second = 0.0035;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"kg_per_open_second", "kg/s", Bounds::between(0.0, 0.1),
                        "gas used by an open thruster"},
          self.kg_per_open_second);
  }

  void alter(PlantProperties& plant) const { plant.gas_kg_per_open_second = kg_per_open_second; }

  template <class S>
  void mass(const Instant<S>& now, S& mass, S& weight_mass) const {
    mass -= now.gas_used;
    weight_mass -= now.gas_used;
  }
};

}  // namespace atmos
