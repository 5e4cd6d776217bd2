// Random motions and places for property tests.
#pragma once

#include <rapidcheck.h>

#include "atmos_stl_planner/motion.h"
#include "atmos_stl_planner/specification.h"
#include "formulas.h"

namespace atmos::stl {

inline double grid(int low, int high, double step) { return step * draw(low, high + 1); }

// Cubic segments of 1 to 3 s over [0, horizon], the first one's positions within `reach` dm, each control
// point that near to 0 or, `drift`, to the end of the segment before. `free_time`: h is cubic too.
inline Motion random_motion(std::size_t robots, int horizon_s, bool free_time, int reach = 30,
                            bool drift = false) {
  std::vector<Segment> segments;
  std::vector<Eigen::Vector2d> p(robots, Eigen::Vector2d::Zero());
  for (int t = 0; t < horizon_s;) {
    const int length = std::min(horizon_s - t, draw(1, 4));
    Segment segment;
    if (free_time) {
      const double low = grid(10, 20, 0.01), high = grid(10, 20, 0.01);
      segment.time.resize(4);
      segment.time << t, t + length * low, t + length * (1.0 - high), t + length;
      if (segment.time[2] < segment.time[1]) std::swap(segment.time[1], segment.time[2]);
    } else {
      segment.time.resize(2);
      segment.time << t, t + length;
    }
    for (std::size_t i = 0; i < robots; ++i) {
      Eigen::Matrix2Xd r(2, 4);
      r.col(0) = p[i];
      const Eigen::Vector2d around = drift ? p[i] : Eigen::Vector2d::Zero();
      for (int k = 1; k < 4; ++k)
        r.col(k) << around.x() + grid(-reach, reach, 0.1), around.y() + grid(-reach, reach, 0.1);
      p[i] = r.col(3);
      segment.position.push_back(r);
    }
    segments.push_back(segment);
    t += length;
  }
  return Motion(std::move(segments));
}

// An upper bound of the speed of every coordinate.
inline double top_speed(const Motion& motion) {
  double top = 0.0;
  for (const Segment& segment : motion.segments()) {
    const Eigen::Index n = segment.time.size() - 1;
    const double slowest = static_cast<double>(n) * (segment.time.tail(n) - segment.time.head(n)).minCoeff();
    for (const Eigen::Matrix2Xd& r : segment.position) {
      const Eigen::Index m = r.cols() - 1;
      top = std::max(
          top, static_cast<double>(m) * (r.rightCols(m) - r.leftCols(m)).cwiseAbs().maxCoeff() / slowest);
    }
  }
  return top;
}

inline std::vector<Region> random_regions(int horizon_s) {
  std::vector<Region> regions;
  for (int i = 0; i < 3; ++i) {
    Region region;
    region.name = std::string(1, static_cast<char>('A' + i));
    const Eigen::Vector2d center(grid(-20, 20, 0.1), grid(-20, 20, 0.1));
    if (i < 2) {
      region.polytope = box(center - Eigen::Vector2d(grid(2, 10, 0.1), grid(2, 10, 0.1)),
                            center + Eigen::Vector2d(0.3, 0.5));
    } else {
      region.polytope =
          *polygon({center, center + Eigen::Vector2d(1.0, 0.2), center + Eigen::Vector2d(0.1, 1.5)});
      region.path = {{0.3 * horizon_s, {0, 0}}, {0.6 * horizon_s, {grid(-10, 10, 0.1), 1.0}}};
    }
    regions.push_back(region);
  }
  return regions;
}

}  // namespace atmos::stl
