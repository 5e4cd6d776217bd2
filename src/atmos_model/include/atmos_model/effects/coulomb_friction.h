#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The bearings rub: a force against each bearing's own velocity.
struct CoulombFriction : EffectHooks {
  static constexpr const char* kKind = "coulomb_friction";
  static constexpr const char* kEquation =
      "at each bearing -coefficient (M g / 3) against its own velocity, smooth below 2 mm/s";

  double coefficient = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"coefficient", "1", Bounds::between(0.0, 0.5), "friction over normal force"},
          self.coefficient);
  }

  double time_scale() const { return friction_time_scale(coefficient); }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    add_bearing_friction(
        now, coefficient, [](const Vec2<S>&) { return true; }, wrench);
  }
};

}  // namespace atmos
