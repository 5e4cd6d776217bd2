// The closed curves a scenario can ask for, as functions of time.
#pragma once

#include "atmos_model/scenario.h"

namespace atmos {

// One coordinate with its first and second time derivative.
struct Derivatives {
  double value, rate, acceleration;
};

struct ShapePoint {
  Derivatives x, y;  // m, world
  Derivatives yaw;   // rad, not wrapped
};

// The point `t` seconds after the start of the curve; 0 <= t <= duration_s. The speed along the curve rises
// and falls smoothly over the first and the last fifth of the time.
ShapePoint shape_at(const TrajectorySettings& settings, double t);

}  // namespace atmos
