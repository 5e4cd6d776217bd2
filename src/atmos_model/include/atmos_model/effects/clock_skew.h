#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The mocap's clock runs faster or slower than the robot's.
struct ClockSkew : EffectHooks {
  static constexpr const char* kKind = "clock_skew";
  static constexpr const char* kEquation = "a pose stamp is t0 + (t - t0)(1 + ratio) + latency";

  double ratio = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"ratio", "1", Bounds::between(-0.01, 0.01), "0: none"}, self.ratio);
  }

  void alter(PlantProperties& plant) const { plant.stamp_skew = ratio; }
};

}  // namespace atmos
