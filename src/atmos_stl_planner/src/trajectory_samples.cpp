#include "atmos_stl_planner/trajectory_samples.h"

#include <algorithm>
#include <cmath>

namespace atmos::stl {

std::vector<TrajectorySample> samples(const Specification& spec, const Motion& motion, std::size_t robot,
                                      double period_s, double from_s) {
  const Robot& of = spec.robots[robot];
  const double yaw_start = of.start.yaw_rad;
  const double turn = of.end ? std::remainder(of.end->yaw_rad - yaw_start, 2.0 * M_PI) : 0.0;
  std::vector<double> times = {from_s};
  for (const Segment& segment : motion.segments()) {
    const double begin = std::max(from_s, segment.time[0]), end = segment.time[segment.time.size() - 1];
    if (end <= from_s) continue;
    const int parts = std::max(1, static_cast<int>(std::ceil((end - begin) / period_s - 1e-9)));
    for (int k = 1; k <= parts; ++k) times.push_back(begin + (end - begin) * k / parts);
  }
  std::vector<TrajectorySample> result;
  for (const double t : times) {
    const double s = std::clamp(t / spec.horizon_s, 0.0, 1.0), h = spec.horizon_s;
    TrajectorySample sample;
    sample.time_s = t;
    sample.state = motion.at(robot, t);
    sample.yaw_rad = yaw_start + turn * s * s * s * (10.0 + s * (6.0 * s - 15.0));
    sample.yaw_rate_rad_s = turn * 30.0 * s * s * (1.0 - s) * (1.0 - s) / h;
    sample.yaw_acceleration_rad_s2 = turn * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (h * h);
    result.push_back(sample);
  }
  return result;
}

}  // namespace atmos::stl
