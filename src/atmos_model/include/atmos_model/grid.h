// Values on a regular grid over the floor: rows [j][i] belong to origin + spacing * (i, j); outside, the
// nearest edge.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "atmos_model/planar.h"

namespace atmos {

// The number inside an automatic-differentiation scalar; overloads for those are found by argument-dependent
// lookup.
inline double plain_value(double x) { return x; }

struct Grid {
  std::array<double, 2> origin_m{0.0, 0.0};
  double spacing_m = 1.0;
};

using GridRows = std::vector<std::vector<double>>;

// Where a coordinate lies along one axis of `nodes` nodes: cell, fraction in it, and whether it was clamped.
template <class S>
struct GridPlace {
  int cell;
  S fraction;
  bool clamped;
};

template <class S>
GridPlace<S> locate(const S& x, double origin, double spacing, int nodes) {
  const S u = (x - origin) / spacing;
  const double value = plain_value(u), last = nodes - 1;
  if (!(value > 0.0) || nodes < 2) return {0, S(0), true};
  if (value >= last) return {nodes - 2, S(1), true};
  const int cell = std::min(static_cast<int>(value), nodes - 2);
  return {cell, u - static_cast<double>(cell), false};
}

template <class S>
S bilinear(const Grid& grid, const GridRows& rows, const Vec2<S>& p_W) {
  const int nx = static_cast<int>(rows.front().size()), ny = static_cast<int>(rows.size());
  const GridPlace<S> x = locate<S>(p_W.x(), grid.origin_m[0], grid.spacing_m, nx);
  const GridPlace<S> y = locate<S>(p_W.y(), grid.origin_m[1], grid.spacing_m, ny);
  const std::size_t i = static_cast<std::size_t>(x.cell), j = static_cast<std::size_t>(y.cell);
  const std::size_t i1 = std::min(i + 1, rows.front().size() - 1), j1 = std::min(j + 1, rows.size() - 1);
  const S low = (S(1) - x.fraction) * rows[j][i] + x.fraction * rows[j][i1];
  const S high = (S(1) - x.fraction) * rows[j1][i] + x.fraction * rows[j1][i1];
  return (S(1) - y.fraction) * low + y.fraction * high;
}

// Weights of the four nodes around a cell for the interpolating cubic (Catmull-Rom), and their derivatives
// per cell.
template <class S>
void cubic_weights(const S& t, S* value, S* slope) {
  const S t2 = t * t, t3 = t2 * t;
  value[0] = -0.5 * t3 + t2 - 0.5 * t;
  value[1] = 1.5 * t3 - 2.5 * t2 + S(1);
  value[2] = -1.5 * t3 + 2.0 * t2 + 0.5 * t;
  value[3] = 0.5 * t3 - 0.5 * t2;
  slope[0] = -1.5 * t2 + 2.0 * t - S(0.5);
  slope[1] = 4.5 * t2 - 5.0 * t;
  slope[2] = -4.5 * t2 + 4.0 * t + S(0.5);
  slope[3] = 1.5 * t2 - t;
}

// Gradient of the bicubic surface, per metre; an axis on which the place is clamped has none.
template <class S>
Vec2<S> bicubic_gradient(const Grid& grid, const GridRows& rows, const Vec2<S>& p_W) {
  const int nx = static_cast<int>(rows.front().size()), ny = static_cast<int>(rows.size());
  const GridPlace<S> x = locate<S>(p_W.x(), grid.origin_m[0], grid.spacing_m, nx);
  const GridPlace<S> y = locate<S>(p_W.y(), grid.origin_m[1], grid.spacing_m, ny);
  S wx[4], sx[4], wy[4], sy[4];
  cubic_weights(x.fraction, wx, sx);
  cubic_weights(y.fraction, wy, sy);
  Vec2<S> gradient = Vec2<S>::Zero();
  for (int b = 0; b < 4; ++b) {
    const auto& row = rows[static_cast<std::size_t>(std::clamp(y.cell + b - 1, 0, ny - 1))];
    S value(0), slope(0);
    for (int a = 0; a < 4; ++a) {
      const double node = row[static_cast<std::size_t>(std::clamp(x.cell + a - 1, 0, nx - 1))];
      value += wx[a] * node;
      slope += sx[a] * node;
    }
    if (!x.clamped) gradient.x() += wy[b] * slope;
    if (!y.clamped) gradient.y() += sy[b] * value;
  }
  return gradient / S(grid.spacing_m);
}

}  // namespace atmos
