#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The floor is a tilted plane: each bearing is pushed down the slope by its share of the weight.
struct FloorTilt : EffectHooks {
  static constexpr const char* kKind = "floor_tilt";
  static constexpr const char* kEquation =
      "-(M g / 3) slope at each bearing; positive slope_x: the floor rises along world +x";

  double slope_x = 0.0;
  double slope_y = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"slope_x", "m/m", Bounds::between(-0.05, 0.05), "rise along world +x"}, self.slope_x);
    visit(ParameterInfo{"slope_y", "m/m", Bounds::between(-0.05, 0.05), "rise along world +y"}, self.slope_y);
  }

  template <class S>
  void slope(const Vec2<S>& /*p_W*/, Vec2<S>& slope_W) const {
    slope_W += Vec2<S>(S(slope_x), S(slope_y));
  }
};

}  // namespace atmos
