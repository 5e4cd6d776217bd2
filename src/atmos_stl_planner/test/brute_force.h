// The definition of robustness, written down as it stands and evaluated on samples: slow, simple, and without
// a line in common with the checker.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "atmos_stl_planner/motion.h"
#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

class BruteForce {
 public:
  // Window ends must be multiples of step_s.
  BruteForce(const std::vector<Region>& regions, const Motion& motion, double step_s)
      : regions_(regions), motion_(motion), step_s_(step_s) {
    last_ = static_cast<int>(std::lround((motion.end_s() - motion.start_s()) / step_s));
  }

  double robustness(const Formula& f) const { return signal(f)[0]; }

  // A bound of how fast any formula's robustness changes, per s, given that of every coordinate.
  static double slope(double velocity) { return 2.0 * velocity; }

 private:
  std::vector<double> signal(const Formula& f) const {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::vector<std::vector<double>> parts;
    for (const FormulaPtr& child : f.children) parts.push_back(signal(*child));
    const int a = static_cast<int>(std::lround(f.from_s / step_s_)),
              b = static_cast<int>(std::lround(f.to_s / step_s_));
    std::vector<double> result(static_cast<std::size_t>(last_) + 1, nan);
    for (int t = 0; t <= last_; ++t) {
      double& r = result[static_cast<std::size_t>(t)];
      const auto part = [&](std::size_t i, int at) { return parts[i][static_cast<std::size_t>(at)]; };
      switch (f.op) {
        case Op::kTrue:
          r = std::numeric_limits<double>::infinity();
          break;
        case Op::kIn:
          r = inside(f, t);
          break;
        case Op::kLinear:
          r = f.constant;
          for (const LinearTerm& term : f.terms) r += term.coefficient * position(term.robot, t)[term.axis];
          break;
        case Op::kNot:
          r = -part(0, t);
          break;
        case Op::kAnd:
        case Op::kOr:
          r = part(0, t);
          for (std::size_t i = 1; i < parts.size(); ++i)
            r = f.op == Op::kAnd ? std::min(r, part(i, t)) : std::max(r, part(i, t));
          break;
        case Op::kEventually:
        case Op::kAlways:
          if (t + b > last_) break;
          r = part(0, t + a);
          for (int u = t + a; u <= t + b; ++u)
            r = f.op == Op::kAlways ? std::min(r, part(0, u)) : std::max(r, part(0, u));
          break;
        case Op::kUntil: {
          if (t + b > last_) break;
          r = -std::numeric_limits<double>::infinity();
          double held = std::numeric_limits<double>::infinity();
          for (int u = t; u <= t + b; ++u) {
            held = std::min(held, part(0, u));
            if (u >= t + a) r = std::max(r, std::min(held, part(1, u)));
          }
          break;
        }
        case Op::kRelease:
          break;
      }
    }
    return result;
  }

  Eigen::Vector2d position(int robot, int t) const {
    return motion_.at(static_cast<std::size_t>(robot), motion_.start_s() + t * step_s_).p_WB;
  }

  double inside(const Formula& f, int t) const {
    const Region& region = regions_[static_cast<std::size_t>(f.region)];
    const Eigen::Vector2d p = position(f.robot, t) - region.displacement(motion_.start_s() + t * step_s_);
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 0; k < region.polytope.offsets.size(); ++k)
      least = std::min(least, region.polytope.offsets[k] - region.polytope.normals.row(k).dot(p));
    return least;
  }

  const std::vector<Region>& regions_;
  const Motion& motion_;
  double step_s_;
  int last_;
};

}  // namespace atmos::stl
