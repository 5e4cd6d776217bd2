#include "atmos_nmpc/trajectory.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

using namespace state13;

constexpr double kUnitTolerance = 1e-3;

Eigen::Quaterniond quaternion(const Quaternion4<double>& q) { return {q[0], q[1], q[2], q[3]}; }

}  // namespace

bool operator==(const ReferencePoint& a, const ReferencePoint& b) {
  return a.x == b.x && a.motion.acceleration_W == b.motion.acceleration_W &&
         a.motion.rate_B == b.motion.rate_B &&
         a.motion.angular_acceleration_B == b.motion.angular_acceleration_B;
}

ReferencePoint at_rest(const Vec3<double>& p_WB, const Quaternion4<double>& q_WB) {
  ReferencePoint point;
  point.x.segment<3>(kPosition) = p_WB;
  point.x.segment<4>(kQuaternion) = q_WB;
  return point;
}

std::string trajectory_fault(const std::vector<TrajectoryPoint>& points) {
  if (points.size() < 2) return "fewer than two points";
  if (points.size() > Trajectory::kMaxPoints) return "too many points";
  for (std::size_t i = 0; i < points.size(); ++i) {
    const TrajectoryPoint& point = points[i];
    const std::string name = "point " + std::to_string(i);
    if (!std::isfinite(point.time_s) || !point.p_WB.allFinite() || !point.v_WB.allFinite() ||
        !point.w_WB_W.allFinite() || !point.a_WB.allFinite() ||
        !(std::abs(point.q_WB.norm() - 1.0) < kUnitTolerance))
      return name + " is not finite or has no attitude";
    if (i > 0 && !(point.time_s > points[i - 1].time_s)) return name + " is not later than the one before it";
  }
  return {};
}

ReferencePoint Trajectory::at(double time_s) const {
  if (time_s <= start_s()) return at_rest(points_.front().p_WB, points_.front().q_WB);
  if (time_s >= end_s()) return at_rest(points_.back().p_WB, points_.back().q_WB);
  const auto later = std::upper_bound(points_.begin(), points_.end(), time_s,
                                      [](double t, const TrajectoryPoint& p) { return t < p.time_s; });
  const TrajectoryPoint &a = *(later - 1), &b = *later;
  const double h = b.time_s - a.time_s, s = (time_s - a.time_s) / h;

  ReferencePoint point;
  point.x.segment<3>(kPosition) = (1 + 2 * s) * (1 - s) * (1 - s) * a.p_WB +
                                  s * (1 - s) * (1 - s) * h * a.v_WB + s * s * (3 - 2 * s) * b.p_WB +
                                  s * s * (s - 1) * h * b.v_WB;
  point.x.segment<3>(kVelocity) =
      6 * s * (1 - s) / h * (b.p_WB - a.p_WB) + (1 - s) * (1 - 3 * s) * a.v_WB + s * (3 * s - 2) * b.v_WB;
  point.motion.acceleration_W = (1 - s) * a.a_WB + s * b.a_WB;
  const Eigen::Quaterniond q = quaternion(a.q_WB).slerp(s, quaternion(b.q_WB)).normalized();
  point.x.segment<4>(kQuaternion) << q.w(), q.x(), q.y(), q.z();
  const Eigen::Quaterniond q_BW = q.conjugate();
  point.motion.rate_B = q_BW * Vec3<double>((1 - s) * a.w_WB_W + s * b.w_WB_W);
  point.motion.angular_acceleration_B = q_BW * Vec3<double>((b.w_WB_W - a.w_WB_W) / h);
  point.x.segment<3>(kAngularVelocity) = point.motion.rate_B;
  return point;
}

}  // namespace atmos
