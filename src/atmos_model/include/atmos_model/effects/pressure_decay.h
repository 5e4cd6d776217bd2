#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Thrust falls with the gas that has been used.
struct PressureDecay : EffectHooks {
  static constexpr const char* kKind = "pressure_decay";
  static constexpr const char* kEquation = "f_i <- f_i (1 - fraction_per_kg g)";

  double fraction_per_kg = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"fraction_per_kg", "1/kg", Bounds::between(-1.0, 10.0),
                        "thrust lost per kilogram used"},
          self.fraction_per_kg);
  }

  template <class S>
  void thrust(const Instant<S>& now, const S*, ThrustStage<S>& stage) const {
    stage.supply *= S(1) - fraction_per_kg * now.gas_used;
  }
};

}  // namespace atmos
