#include "atmos_mocap_bridge/clock_map.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace atmos {

namespace {

constexpr double kWindow_s = 1.0;
constexpr std::size_t kWindows = 180;
constexpr double kDriftFrom_s = 20.0;  // remote time after which the drift can be told from the jitter
constexpr double kMostDrift = 5e-4;    // of the clocks of two computers
constexpr double kJump_s = 0.05;       // earlier than any frame could be: a clock was set
constexpr double kLate_s = 0.5;        // later than any network makes a frame ...
constexpr double kLateFor_s = 3.0;     // ... for so long: a clock was set
constexpr double kLeastStep_s = 1e-6;

}  // namespace

void ClockMap::restart(double remote_s, double delay_s) {
  points_.assign(1, {remote_s, delay_s});
  window_end_ = remote_s + kWindow_s;
  slope_ = 0.0;
  reference_ = remote_s;
  delay_ = delay_s;
  late_since_ = last_result_ = kNever;
  ++restarts_;
}

double ClockMap::add(double remote_s, double arrival_s) {
  const double delay = arrival_s - remote_s;
  const double expected = delay_ + slope_ * (remote_s - reference_);
  const bool late = delay > expected + kLate_s;
  if (!late)
    late_since_ = kNever;
  else if (late_since_ == kNever)
    late_since_ = remote_s;
  if (points_.empty() || remote_s < last_remote_ || delay < expected - kJump_s ||
      (late && remote_s - late_since_ > kLateFor_s)) {
    restart(remote_s, delay);
  } else if (remote_s >= window_end_) {
    points_.push_back({remote_s, delay});
    if (points_.size() > kWindows) points_.pop_front();
    window_end_ = remote_s + kWindow_s;
    fit();
  } else if (delay < points_.back().delay_s) {
    points_.back() = {remote_s, delay};
  }
  last_remote_ = remote_s;
  // Below all points at any time, not only after the next fit.
  delay_ = std::min(delay_, delay - slope_ * (remote_s - reference_));
  offset_ = delay_ + slope_ * (remote_s - reference_);
  last_result_ = std::max(remote_s + offset_, last_result_ + kLeastStep_s);
  return last_result_;
}

void ClockMap::fit() {
  const double first = points_.front().remote_s;
  const double middle = 0.5 * (first + points_.back().remote_s);
  slope_ = 0.0;
  if (points_.back().remote_s - first >= kDriftFrom_s) {
    // Lower hull from left to right; the edge that passes over the middle has the least distance to the
    // points.
    std::vector<Point> hull;
    const auto turns_right = [](const Point& a, const Point& b, const Point& c) {
      return (b.remote_s - a.remote_s) * (c.delay_s - a.delay_s) <=
             (c.remote_s - a.remote_s) * (b.delay_s - a.delay_s);
    };
    for (const Point& point : points_) {
      while (hull.size() >= 2 && turns_right(hull[hull.size() - 2], hull.back(), point)) hull.pop_back();
      hull.push_back(point);
    }
    const auto right = std::find_if(hull.begin() + 1, hull.end() - 1,
                                    [middle](const Point& point) { return point.remote_s >= middle; });
    const Point &a = *(right - 1), &b = *right;
    slope_ = std::clamp((b.delay_s - a.delay_s) / (b.remote_s - a.remote_s), -kMostDrift, kMostDrift);
  }
  reference_ = points_.back().remote_s;
  delay_ = std::numeric_limits<double>::infinity();
  for (const Point& point : points_)
    delay_ = std::min(delay_, point.delay_s - slope_ * (point.remote_s - reference_));
}

}  // namespace atmos
