#pragma once

#include "atmos_model/effect.h"
#include "atmos_model/vehicle.h"

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
  void force(const Instant<S>& now, const S* /*hidden*/, PlanarWrench<S>& wrench) const {
    const double bearings = static_cast<double>(now.plant.bearings_m.size());
    const Eigen::Matrix<S, 2, 2> R_WB = rotation_WB(now.state.yaw);
    const Vec2<S> share_W = -(now.mass * (kGravity / bearings)) * Vec2<S>(S(slope_x), S(slope_y));
    for (const Eigen::Vector2d& bearing : now.plant.bearings_m) {
      const Eigen::Vector2d from_com_B = bearing - now.plant.com_B;
      wrench.add_force_at(share_W, R_WB * from_com_B.cast<S>());
    }
  }
};

}  // namespace atmos
