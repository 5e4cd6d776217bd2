#pragma once

#include "atmos_model/effect.h"
#include "atmos_model/grid.h"

namespace atmos {

// The floor's height on a grid: each bearing is pushed down the local slope by its share of the weight.
struct FloorUnevenness : EffectHooks {
  static constexpr const char* kKind = "floor_unevenness";
  static constexpr const char* kEquation =
      "-(M g / 3) grad h at each bearing's place; h bicubic between nodes, clamped outside";

  Grid grid;
  std::vector<std::vector<double>> height_m;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(grid_origin(), self.grid.origin_m);
    visit(grid_spacing(), self.grid.spacing_m);
    visit(
        ParameterInfo{"height_m", "m", Bounds::between(-0.1, 0.1), "rows [j][i] at origin + spacing (i, j)"},
        self.height_m);
  }

  template <class S>
  void slope(const Vec2<S>& p_W, Vec2<S>& slope_W) const {
    slope_W += bicubic_gradient(grid, height_m, p_W);
  }
};

}  // namespace atmos
