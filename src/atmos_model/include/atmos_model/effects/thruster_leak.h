#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// A valve leaks all the time: scaled by plenum and pressure, not by coupling; it counts neither in n nor in
// gas.
struct ThrusterLeak : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "thruster_leak";
  static constexpr const char* kEquation = "adds fraction F_k d_k at r_k at all times";

  int thruster = 1;
  double fraction = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(thruster_number(), self.thruster);
    visit(ParameterInfo{"fraction", "1", Bounds::between(0.0, 1.0), "of this thruster's force"},
          self.fraction);
  }

  template <class S>
  void thrust(const Instant<S>& now, const S*, ThrustStage<S>& stage) const {
    stage.leak[thruster - 1] += S(fraction * now.plant.thruster(thruster).force_n);
  }
};

}  // namespace atmos
