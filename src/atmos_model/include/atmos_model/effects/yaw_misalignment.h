#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The mocap body's axes are turned against the robot's.
struct YawMisalignment : EffectHooks {
  static constexpr const char* kKind = "yaw_misalignment";
  static constexpr const char* kEquation = "the mocap shows yaw + angle_rad";

  double angle_rad = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"angle_rad", "rad", Bounds::between(-3.2, 3.2), "about world z"}, self.angle_rad);
  }

  void alter(PlantProperties& plant) const { plant.mocap_yaw_offset_rad = angle_rad; }
};

}  // namespace atmos
