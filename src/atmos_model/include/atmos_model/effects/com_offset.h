#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The centre of mass is not the geometric centre: moves the levers of thrusters and bearings, and the
// measured point.
struct ComOffset : EffectHooks {
  static constexpr const char* kKind = "com_offset";
  static constexpr const char* kEquation = "c = (x_m, y_m)";

  double x_m = 0.0;
  double y_m = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"x_m", "m", Bounds::between(-0.2, 0.2), "along body x"}, self.x_m);
    visit(ParameterInfo{"y_m", "m", Bounds::between(-0.2, 0.2), "along body y"}, self.y_m);
  }

  void alter(PlantProperties& plant) const { plant.com_B = {x_m, y_m}; }
};

}  // namespace atmos
