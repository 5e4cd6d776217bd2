#include "atmos_stl_planner/motion.h"

#include <algorithm>

#include "atmos_stl_planner/bernstein.h"

namespace atmos::stl {

namespace {

constexpr double kMinCut_s = 1e-9;  // shorter pieces are not cut off

double first(const Eigen::VectorXd& c) { return c[0]; }
double last(const Eigen::VectorXd& c) { return c[c.size() - 1]; }

Segment rest(const Segment& at, bool end, double from_s, double to_s) {
  Segment segment;
  segment.time.resize(2);
  segment.time << from_s, to_s;
  for (const Eigen::Matrix2Xd& points : at.position) {
    const Eigen::Vector2d p = end ? points.rightCols<1>() : points.leftCols<1>();
    segment.position.emplace_back(p.replicate<1, 2>());
  }
  return segment;
}

}  // namespace

MotionState Motion::at(std::size_t robot, double time_s) const {
  const auto after =
      std::upper_bound(segments_.begin(), segments_.end(), time_s,
                       [](double t, const Segment& segment) { return t < first(segment.time); });
  const Segment& segment = after == segments_.begin() ? segments_.front() : *(after - 1);
  const double s = bernstein::inverse(segment.time, time_s);
  const Eigen::VectorXd dh = bernstein::derivative(segment.time), ddh = bernstein::derivative(dh);
  const double h1 = bernstein::value(dh, s), h2 = bernstein::value(ddh, s);
  MotionState state;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const Eigen::VectorXd r = segment.position[robot].row(axis).transpose();
    const Eigen::VectorXd dr = bernstein::derivative(r), ddr = bernstein::derivative(dr);
    const double v = bernstein::value(dr, s) / h1;
    state.p_WB[axis] = bernstein::value(r, s);
    state.v_WB[axis] = v;
    state.a_WB[axis] = (bernstein::value(ddr, s) - v * h2) / (h1 * h1);
  }
  return state;
}

Motion Motion::cut_at(const std::vector<double>& times_s) const {
  std::vector<double> times = times_s;
  std::sort(times.begin(), times.end());
  std::vector<Segment> result;
  for (const Segment& whole : segments_) {
    Segment remaining = whole;
    for (const double time : times) {
      if (!(time > first(remaining.time) + kMinCut_s && time < last(remaining.time) - kMinCut_s)) continue;
      const double s = bernstein::inverse(remaining.time, time);
      Segment before;
      auto [h_before, h_after] = bernstein::split(remaining.time, s);
      h_before[h_before.size() - 1] = h_after[0] = time;
      before.time = h_before;
      remaining.time = h_after;
      for (Eigen::Matrix2Xd& points : remaining.position) {
        Eigen::Matrix2Xd left(2, points.cols());
        for (Eigen::Index axis = 0; axis < 2; ++axis) {
          auto [a, b] = bernstein::split(points.row(axis).transpose(), s);
          left.row(axis) = a.transpose();
          points.row(axis) = b.transpose();
        }
        before.position.push_back(left);
      }
      result.push_back(before);
    }
    result.push_back(remaining);
  }
  return Motion(std::move(result));
}

Motion Motion::with_rests(double rest_s) const {
  std::vector<Segment> result;
  result.push_back(rest(segments_.front(), false, start_s() - rest_s, start_s()));
  result.insert(result.end(), segments_.begin(), segments_.end());
  result.push_back(rest(segments_.back(), true, end_s(), end_s() + rest_s));
  return Motion(std::move(result));
}

Motion polyline(const std::vector<double>& times_s, const std::vector<std::vector<Eigen::Vector2d>>& points) {
  std::vector<Segment> segments;
  for (std::size_t k = 0; k + 1 < times_s.size(); ++k) {
    Segment segment;
    segment.time.resize(2);
    segment.time << times_s[k], times_s[k + 1];
    for (std::size_t robot = 0; robot < points[k].size(); ++robot) {
      Eigen::Matrix2Xd line(2, 2);
      line << points[k][robot], points[k + 1][robot];
      segment.position.push_back(line);
    }
    segments.push_back(segment);
  }
  return Motion(std::move(segments));
}

}  // namespace atmos::stl
