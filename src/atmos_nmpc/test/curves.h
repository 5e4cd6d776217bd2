// A curve to follow, and how far a flight is off it.
#pragma once

#include <cmath>
#include <vector>

#include "atmos_nmpc/trajectory.h"
#include "closed_loop.h"

namespace atmos::testing {

// One lap in `duration_s` around the origin with the yaw along it, from rest to rest (speed sin^2).
inline std::vector<TrajectoryPoint> circle(double start_s, double duration_s, double radius) {
  std::vector<TrajectoryPoint> points;
  const int steps = static_cast<int>(std::lround(duration_s / 0.1));
  for (int k = 0; k <= steps; ++k) {
    const double t = duration_s * k / steps, n = 2.0 * M_PI / duration_s;
    const double a = n * t - std::sin(n * t), w = n * (1.0 - std::cos(n * t)), dw = n * n * std::sin(n * t);
    const double c = std::cos(a), s = std::sin(a);
    points.push_back({start_s + t,
                      {radius * c, radius * s, 0.0},
                      {std::cos(0.5 * a), 0.0, 0.0, std::sin(0.5 * a)},
                      {-radius * w * s, radius * w * c, 0.0},
                      {0.0, 0.0, w},
                      {radius * (-dw * s - w * w * c), radius * (dw * c - w * w * s), 0.0}});
  }
  return points;
}

struct TrackingError {
  double position_rms_m = 0.0;
  double yaw_rms_rad = 0.0;
};

// Flies `periods` and compares base_link with the trajectory while it lasts.
inline TrackingError track(Flight& flight, const std::vector<TrajectoryPoint>& points, int periods) {
  const Trajectory trajectory(points);
  TrackingError error;
  int count = 0;
  for (int k = 0; k < periods; ++k) {
    const FlightRow row = flight.period();
    if (row.time_s < trajectory.start_s() || row.time_s > trajectory.end_s()) continue;
    const State13<double> wanted = trajectory.at(row.time_s).x;
    error.position_rms_m += (row.truth.p_WC - wanted.head<2>()).squaredNorm();
    const double yaw = 2.0 * std::atan2(wanted[state13::kQuaternion + 3], wanted[state13::kQuaternion]);
    error.yaw_rms_rad += std::pow(wrap_angle(row.truth.yaw - yaw), 2);
    ++count;
  }
  error.position_rms_m = std::sqrt(error.position_rms_m / count);
  error.yaw_rms_rad = std::sqrt(error.yaw_rms_rad / count);
  return error;
}

}  // namespace atmos::testing
