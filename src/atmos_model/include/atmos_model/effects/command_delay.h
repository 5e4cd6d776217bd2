#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Every command acts later than its stamp says.
struct CommandDelay : EffectHooks {
  static constexpr const char* kKind = "command_delay";
  static constexpr const char* kEquation = "every command acts delay_s after its stamp";

  double delay_s = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"delay_s", "s", Bounds::between(-0.5, 0.5), "stamp to action"}, self.delay_s);
  }

  void alter(PlantProperties& plant) const { plant.timing.command_delay_s += delay_s; }
};

}  // namespace atmos
