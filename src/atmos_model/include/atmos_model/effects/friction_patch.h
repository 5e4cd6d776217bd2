#pragma once

#include <algorithm>

#include "atmos_model/effect.h"

namespace atmos {

// A dirty or scratched place on the floor: bearings rub only inside a disc.
struct FrictionPatch : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "friction_patch";
  static constexpr const char* kEquation =
      "as coulomb_friction, only for bearings within radius_m of (center_x_m, center_y_m)";

  double coefficient = 0.0;
  double center_x_m = 0.0;
  double center_y_m = 0.0;
  double radius_m = 0.1;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"coefficient", "1", Bounds::between(0.0, 0.5), "friction over normal force"},
          self.coefficient);
    visit(ParameterInfo{"center_x_m", "m", Bounds::between(-50.0, 50.0), "world x"}, self.center_x_m);
    visit(ParameterInfo{"center_y_m", "m", Bounds::between(-50.0, 50.0), "world y"}, self.center_y_m);
    visit(ParameterInfo{"radius_m", "m", Bounds::between(0.01, 20.0), ""}, self.radius_m);
  }

  // The edge is sharp: a long step across it would take the whole of it for rough or for smooth.
  double time_scale() const { return std::min(4e-3, friction_time_scale(coefficient)); }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    const Vec2<S> center_W{S(center_x_m), S(center_y_m)};
    add_bearing_friction(
        now, coefficient,
        [&](const Vec2<S>& p_W) { return (p_W - center_W).squaredNorm() <= radius_m * radius_m; }, wrench);
  }
};

}  // namespace atmos
