#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Valves take time to open and to close.
struct ValveDelay : EffectHooks {
  static constexpr const char* kKind = "valve_delay";
  static constexpr const char* kEquation =
      "a joined open interval [a, b) of a valve becomes [a + open_s, b + close_s); nothing if that is empty";

  double open_s = 0.0;
  double close_s = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"open_s", "s", Bounds::between(0.0, 0.2), "command to open"}, self.open_s);
    visit(ParameterInfo{"close_s", "s", Bounds::between(0.0, 0.2), "command to closed"}, self.close_s);
  }

  void alter(PlantProperties& plant) const {
    plant.timing.open_delay_s += open_s;
    plant.timing.close_delay_s += close_s;
  }
};

}  // namespace atmos
