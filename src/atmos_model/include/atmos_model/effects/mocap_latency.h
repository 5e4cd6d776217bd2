#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The pose is older than its stamp says.
struct MocapLatency : EffectHooks {
  static constexpr const char* kKind = "mocap_latency";
  static constexpr const char* kEquation = "a pose stamped t shows the vehicle at t - delay_s";

  double delay_s = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"delay_s", "s", Bounds::between(-0.5, 0.5), "exposure to stamp"}, self.delay_s);
  }

  void alter(PlantProperties& plant) const { plant.mocap_latency_s = delay_s; }
};

}  // namespace atmos
