#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The point the mocap calls the robot is not its geometric centre.
struct MarkerOffset : EffectHooks {
  static constexpr const char* kKind = "marker_offset";
  static constexpr const char* kEquation = "the mocap shows p + R ((x_m, y_m) - c)";

  double x_m = 0.0;
  double y_m = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"x_m", "m", Bounds::between(-0.5, 0.5), "along body x"}, self.x_m);
    visit(ParameterInfo{"y_m", "m", Bounds::between(-0.5, 0.5), "along body y"}, self.y_m);
  }

  void alter(PlantProperties& plant) const { plant.marker_B = {x_m, y_m}; }
};

}  // namespace atmos
