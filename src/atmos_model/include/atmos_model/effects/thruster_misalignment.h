#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// A nozzle is canted in the plane.
struct ThrusterMisalignment : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "thruster_misalignment";
  static constexpr const char* kEquation = "d_k turned by +angle_rad about body z";

  int thruster = 1;
  double angle_rad = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(thruster_number(), self.thruster);
    visit(ParameterInfo{"angle_rad", "rad", Bounds::between(-0.8, 0.8), "about body z"}, self.angle_rad);
  }

  void alter(PlantProperties& plant) const {
    PlanarThruster& canted = plant.thruster(thruster);
    canted.direction = rotation_WB(angle_rad) * canted.direction;
  }
};

}  // namespace atmos
