#pragma once

#include "atmos_model/effect.h"
#include "atmos_model/grid.h"

namespace atmos {

// A steady flow of air pushes the robot with a force that depends on the place.
struct Airflow : EffectHooks {
  static constexpr const char* kKind = "airflow";
  static constexpr const char* kEquation =
      "a force at the centre of mass, bilinear between nodes, clamped outside; one node: uniform";

  Grid grid;
  std::vector<std::vector<double>> force_x_n;
  std::vector<std::vector<double>> force_y_n;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(grid_origin(), self.grid.origin_m);
    visit(grid_spacing(), self.grid.spacing_m);
    visit(ParameterInfo{"force_x_n", "N", Bounds::between(-10.0, 10.0), "rows [j][i], along world x"},
          self.force_x_n);
    visit(ParameterInfo{"force_y_n", "N", Bounds::between(-10.0, 10.0), "rows [j][i], along world y"},
          self.force_y_n);
  }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    wrench.force_W +=
        Vec2<S>(bilinear(grid, force_x_n, now.state.p_WC), bilinear(grid, force_y_n, now.state.p_WC));
  }
};

}  // namespace atmos
