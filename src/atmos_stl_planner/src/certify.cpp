#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "atmos_stl_planner/bernstein.h"
#include "atmos_stl_planner/checker.h"

namespace atmos::stl {

namespace {

using bernstein::Coefficients;

constexpr double kTolerance = 1e-6;

// The share of the limit that is used: least v with v limit h' >= |r'| everywhere, by bisection over exact
// decisions.
template <class Holds>
double least_share(const Holds& holds) {
  double low = 0.0, high = 1.0;
  while (high < 1e6 && !holds(high)) {
    low = high;
    high *= 2.0;
  }
  while (high - low > 1e-7 * std::max(1.0, high)) {
    const double middle = 0.5 * (low + high);
    (holds(middle) ? high : low) = middle;
  }
  return high;
}

bool nowhere_negative(const Coefficients& c, double tolerance) {
  return c.minCoeff() >= -tolerance || bernstein::lower_bound(c, 0.1 * tolerance) >= -tolerance;
}

// v h' - |r'| >= 0 on the segment, per axis.
bool within_velocity(const Segment& segment, std::size_t robot, double limit) {
  const Coefficients dh = bernstein::derivative(segment.time);
  for (int axis = 0; axis < 2; ++axis) {
    const Coefficients dr = bernstein::derivative(segment.position[robot].row(axis).transpose());
    for (const double sign : {1.0, -1.0}) {
      if (!nowhere_negative(bernstein::sum(limit * dh, sign * dr), 1e-12)) return false;
    }
  }
  return true;
}

// x'' = (r'' h' - r' h'') / h'^3, so that a h'^3 - |r'' h' - r' h''| >= 0.
bool within_acceleration(const Segment& segment, std::size_t robot, double limit) {
  const Coefficients dh = bernstein::derivative(segment.time), ddh = bernstein::derivative(dh);
  const Coefficients cube = bernstein::product(bernstein::product(dh, dh), dh);
  for (int axis = 0; axis < 2; ++axis) {
    const Coefficients dr = bernstein::derivative(segment.position[robot].row(axis).transpose());
    const Coefficients ddr = bernstein::derivative(dr);
    const Coefficients turn = bernstein::sum(bernstein::product(ddr, dh), -bernstein::product(dr, ddh));
    for (const double sign : {1.0, -1.0}) {
      if (!nowhere_negative(bernstein::sum(limit * cube, sign * turn), 1e-12)) return false;
    }
  }
  return true;
}

class Judge {
 public:
  Judge(const Specification& spec, const Motion& motion, const CertifyOptions& options)
      : spec_(spec), motion_(motion), options_(options) {}

  Certificate run() {
    if (motion_.empty() || motion_.robots() != spec_.robots.size()) {
      fault("there is no motion for every robot");
      return result_;
    }
    if (!well_formed()) return result_;
    judge_ends();
    judge_workspace();
    judge_limits();
    judge_separation();
    judge_obstacles();
    judge_clauses();
    return result_;
  }

 private:
  __attribute__((format(printf, 2, 3))) void fault(const char* format, ...) {
    char text[300];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    result_.faults.emplace_back(text);
  }

  const char* name(std::size_t robot) const { return spec_.robots[robot].name.c_str(); }

  bool well_formed() {
    for (const Segment& segment : motion_.segments()) {
      bool good = segment.time.allFinite() && segment.time.size() >= 2 &&
                  segment.time[segment.time.size() - 1] > segment.time[0] &&
                  bernstein::lower_bound(bernstein::derivative(segment.time), 1e-9) > 0.0;
      for (const Eigen::Matrix2Xd& r : segment.position) good = good && r.allFinite();
      if (!good) {
        fault("the motion is not finite, or its time stands still");
        return false;
      }
    }
    return true;
  }

  void judge_ends() {
    if (std::abs(motion_.start_s()) > kTolerance || std::abs(motion_.end_s() - spec_.horizon_s) > kTolerance)
      fault("the motion lasts from %.6f to %.6f s", motion_.start_s(), motion_.end_s());
    const auto& segments = motion_.segments();
    for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot) {
      const Robot& asked = spec_.robots[robot];
      if (options_.limits_from_s <= 0.0 &&
          (segments.front().position[robot].col(0) - asked.start.p_WB).norm() > kTolerance)
        fault("%s does not begin at its start", name(robot));
      const Eigen::Matrix2Xd& r = segments.back().position[robot];
      if (asked.end && (r.rightCols<1>() - asked.end->p_WB).norm() > kTolerance)
        fault("%s does not end at its end", name(robot));
      if (motion_.at(robot, motion_.end_s()).v_WB.norm() > kTolerance)
        fault("%s does not end at rest", name(robot));
      for (std::size_t k = 1; k < segments.size(); ++k) {
        const Segment &before = segments[k - 1], &after = segments[k];
        const double t = after.time[0];
        if (before.time[before.time.size() - 1] != t ||
            (before.position[robot].rightCols<1>() - after.position[robot].leftCols<1>()).norm() > kTolerance)
          fault("%s jumps at %.3f s", name(robot), t);
        if (t < options_.limits_from_s - kTolerance) continue;
        if ((end_velocity(before, robot, true) - end_velocity(after, robot, false)).norm() > kTolerance &&
            t > options_.limits_from_s + kTolerance)
          fault("the velocity of %s jumps at %.3f s", name(robot), t);
      }
    }
  }

  static Eigen::Vector2d end_velocity(const Segment& segment, std::size_t robot, bool end) {
    const Eigen::Matrix2Xd& r = segment.position[robot];
    const Coefficients dh = bernstein::derivative(segment.time);
    const double n = static_cast<double>(r.cols() - 1);
    return end ? n * (r.rightCols<1>() - r.col(r.cols() - 2)) / dh[dh.size() - 1]
               : n * (r.col(1) - r.col(0)) / dh[0];
  }

  bool judged(const Segment& segment) const { return segment.time[0] >= options_.limits_from_s - kTolerance; }

  void judge_workspace() {
    for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot) {
      for (const Segment& segment : motion_.segments()) {
        if (!judged(segment)) continue;
        const Eigen::Matrix2Xd& r = segment.position[robot];
        for (Eigen::Index k = 0; k < spec_.workspace.offsets.size(); ++k) {
          const Coefficients inside =
              (spec_.workspace.offsets[k] - (spec_.workspace.normals.row(k) * r).transpose().array())
                  .matrix();
          if (nowhere_negative(inside, kTolerance)) continue;
          fault("%s leaves the workspace after %.3f s", name(robot), segment.time[0]);
          return;
        }
      }
    }
  }

  template <class Within>
  double share(const Within& within, double Robot::*limit) const {
    return least_share([&](double factor) {
      for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot) {
        for (const Segment& segment : motion_.segments()) {
          if (judged(segment) && !within(segment, robot, factor * (spec_.robots[robot].*limit))) return false;
        }
      }
      return true;
    });
  }

  void judge_limits() {
    result_.peak_velocity_share = share(within_velocity, &Robot::max_velocity_m_s);
    result_.peak_acceleration_share = share(within_acceleration, &Robot::max_acceleration_m_s2);
    if (result_.peak_velocity_share > 1.0 + kTolerance)
      fault("the velocity reaches %.4f of its limit", result_.peak_velocity_share);
    if (options_.bound_acceleration && result_.peak_acceleration_share > 1.0 + kTolerance)
      fault("the acceleration reaches %.4f of its limit", result_.peak_acceleration_share);
  }

  void judge_separation() {
    for (std::size_t i = 0; i < spec_.robots.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        double least = std::numeric_limits<double>::infinity(), when = 0.0;
        for (const Segment& segment : motion_.segments()) {
          if (!judged(segment)) continue;
          const Eigen::Matrix2Xd apart = segment.position[i] - segment.position[j];
          const Coefficients dx = apart.row(0).transpose(), dy = apart.row(1).transpose();
          const double square = bernstein::lower_bound(
              bernstein::sum(bernstein::product(dx, dx), bernstein::product(dy, dy)), 1e-8);
          const double distance = std::sqrt(std::max(0.0, square));
          if (distance < least) {
            least = distance;
            when = segment.time[0];
          }
        }
        const double margin = least - spec_.min_distance(i, j);
        result_.separation_m = std::min(result_.separation_m, margin);
        if (margin < -kTolerance)
          fault("%s and %s come %.4f m too near after %.3f s", name(j), name(i), -margin, when);
      }
    }
  }

  void judge_obstacles() {
    if (spec_.obstacles.empty()) return;
    const Checker checker(spec_.obstacles, motion_);
    for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot) {
      for (std::size_t k = 0; k < spec_.obstacles.size(); ++k) {
        auto outside = std::make_shared<Formula>();
        outside->op = Op::kIn;
        outside->negated = true;
        outside->robot = static_cast<int>(robot);
        outside->region = static_cast<int>(k);
        auto always = std::make_shared<Formula>();
        always->op = Op::kAlways;
        always->to_s = motion_.end_s() - options_.limits_from_s;
        always->children = {outside};
        const double margin =
            checker.robustness(always, options_.limits_from_s) - spec_.robots[robot].radius_m;
        result_.obstacle_m = std::min(result_.obstacle_m, margin);
        if (margin < -kTolerance)
          fault("%s comes %.4f m too near to %s", name(robot), -margin, spec_.obstacles[k].name.c_str());
      }
    }
  }

  void judge_clauses() {
    const Checker checker(spec_.regions, motion_);
    const double rest = spec_.horizon_s;
    const Checker shifted(spec_.regions, motion_.with_rests(rest));
    result_.robustness_m = std::numeric_limits<double>::infinity();
    for (const Clause& clause : spec_.clauses) {
      ClauseCertificate own;
      own.robustness_m = checker.robustness(clause.formula);
      own.time_s = checker.critical_time(clause.formula);
      // Late by d: the formula holds at -d of the motion.
      const IntervalSet truth = shifted.truth(*normal_form(clause.formula), 0.0);
      if (const Interval* around = truth.part_at(0.0)) {
        own.lateness_s = std::min(rest, -around->from);
        own.earliness_s = std::min(rest, around->to);
      }
      result_.clauses.push_back(own);
      result_.robustness_m = std::min(result_.robustness_m, own.robustness_m);
      if (own.robustness_m < options_.min_robustness_m - kTolerance)
        fault("%s: robustness %.6f m is less than the %.6f m asked for", clause.text.c_str(),
              own.robustness_m, options_.min_robustness_m);
    }
  }

  const Specification& spec_;
  const Motion& motion_;
  const CertifyOptions& options_;
  Certificate result_;
};

}  // namespace

Certificate certify(const Specification& specification, const Motion& motion, const CertifyOptions& options) {
  return Judge(specification, motion, options).run();
}

}  // namespace atmos::stl
