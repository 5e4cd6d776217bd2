// A reference motion over time: what the topic `trajectory` asks for (docs/nmpc.md, "References").
#pragma once

#include <string>
#include <vector>

#include "atmos_model/rigid_body.h"
#include "atmos_nmpc/rigid_body_step.h"

namespace atmos {

// Where a reference is at one time and how it goes on.
struct ReferencePoint {
  State13<double> x = State13<double>::Zero();  // of base_link
  Motion motion;
};
bool operator==(const ReferencePoint& a, const ReferencePoint& b);
inline bool operator!=(const ReferencePoint& a, const ReferencePoint& b) { return !(a == b); }

// A pose at rest.
ReferencePoint at_rest(const Vec3<double>& p_WB, const Quaternion4<double>& q_WB);

// Times are ROS seconds.
struct TrajectoryPoint {
  double time_s;
  Vec3<double> p_WB;         // m
  Quaternion4<double> q_WB;  // unit length
  Vec3<double> v_WB;         // m/s, world axes
  Vec3<double> w_WB_W;       // rad/s, world axes
  Vec3<double> a_WB;         // m/s^2, world axes
};

// The rule that a list of points breaks; empty if none: finite, times ascending, attitudes of unit length, at
// least two points, at most kMaxPoints.
std::string trajectory_fault(const std::vector<TrajectoryPoint>& points);

// Positions are cubic between the points (their velocities are met), accelerations and angular velocities
// linear, attitudes follow the great circle. Before its start and after its end it rests at its first and
// last pose: a trajectory that ends in motion asks for a stop there, not for more of the motion.
class Trajectory {
 public:
  static constexpr std::size_t kMaxPoints = 100000;

  // Points without a fault.
  explicit Trajectory(std::vector<TrajectoryPoint> points) : points_(std::move(points)) {}

  double start_s() const { return points_.front().time_s; }
  double end_s() const { return points_.back().time_s; }
  ReferencePoint at(double time_s) const;

 private:
  std::vector<TrajectoryPoint> points_;
};

}  // namespace atmos
