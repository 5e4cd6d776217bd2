// How all robots move: Bezier curves r(s) in space over a common Bezier curve h(s) in time (paper, "Planning
// Schemes").
#pragma once

#include <Eigen/Core>
#include <vector>

namespace atmos::stl {

// s in [0, 1]. The fixed time grid has segments with h of degree 1.
struct Segment {
  Eigen::VectorXd time;                    // coefficients of h, s since the start of the plan, increasing
  std::vector<Eigen::Matrix2Xd> position;  // per robot: control points of r, m, one column each
};

struct MotionState {
  Eigen::Vector2d p_WB, v_WB, a_WB;  // m, m/s, m/s^2, world
};

// At least one segment; each begins when and where the one before it ends.
class Motion {
 public:
  Motion() = default;
  explicit Motion(std::vector<Segment> segments) : segments_(std::move(segments)) {}

  const std::vector<Segment>& segments() const { return segments_; }
  bool empty() const { return segments_.empty(); }
  std::size_t robots() const { return empty() ? 0 : segments_.front().position.size(); }
  double start_s() const { return segments_.front().time[0]; }
  double end_s() const { return segments_.back().time[segments_.back().time.size() - 1]; }

  // Clamped to the motion's times.
  MotionState at(std::size_t robot, double time_s) const;

  // The same motion with segments cut at the given times.
  Motion cut_at(const std::vector<double>& times_s) const;
  // The same motion, at rest at its ends for `rest_s` before and after.
  Motion with_rests(double rest_s) const;

 private:
  std::vector<Segment> segments_;
};

// Straight lines between positions: points[k][robot] at times_s[k], which ascend.
Motion polyline(const std::vector<double>& times_s, const std::vector<std::vector<Eigen::Vector2d>>& points);

}  // namespace atmos::stl
