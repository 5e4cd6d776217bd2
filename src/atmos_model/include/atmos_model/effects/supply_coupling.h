#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Thrusters share one supply: every further open valve takes a fixed share of each thrust (paper, "Actuation
// Modules").
struct SupplyCoupling : EffectHooks {
  static constexpr const char* kKind = "supply_coupling";
  static constexpr const char* kEquation =
      "f_i <- f_i (1 - fraction_per_open_thruster * sum of the other openings)";

  double fraction_per_open_thruster = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"fraction_per_open_thruster", "1", Bounds::between(-0.1, 0.33),
                        "thrust lost per further open valve"},
          self.fraction_per_open_thruster);
  }

  template <class S>
  void thrust(const Instant<S>& now, const S* /*hidden*/, ThrustStage<S>& stage) const {
    for (std::size_t i = 0; i < now.plant.thrusters.size(); ++i) {
      stage.own[i] *= S(1) - fraction_per_open_thruster * (now.open_count - now.openings[i]);
    }
  }
};

}  // namespace atmos
