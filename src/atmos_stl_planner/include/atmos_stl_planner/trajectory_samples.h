// A planned motion as points for a controller that interpolates between them.
#pragma once

#include <vector>

#include "atmos_stl_planner/motion.h"
#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

struct TrajectorySample {
  double time_s;  // since the start of the plan
  MotionState state;
  double yaw_rad, yaw_rate_rad_s, yaw_acceleration_rad_s2;
};

// Points from `from_s` to the end of the motion, at most `period_s` apart, with one at every knot: between
// knots the curve is cubic, and so a cubic through position and velocity is the curve itself. Yaw turns from
// that of the start to that of the end, the short way, at rest at both ends of the horizon.
std::vector<TrajectorySample> samples(const Specification& specification, const Motion& motion,
                                      std::size_t robot, double period_s, double from_s = 0.0);

}  // namespace atmos::stl
