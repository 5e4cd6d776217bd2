// ROS time of instants that another computer's clock has stamped.
#pragma once

#include <cstddef>
#include <deque>
#include <limits>

namespace atmos {

// Frames arrive some time after they were stamped: at least the shortest way, often longer, never shorter. So
// the two clocks' relation is the line that runs below all points (remote stamp, arrival - remote stamp), as
// close to them as possible: the edge of their lower convex hull over the mean stamp (Moon, Skelly and
// Towsley, "Estimation and removal of clock skew from network delay measurements", INFOCOM 1999). Late
// frames, however many, do not move it. What stays unknown is the shortest way itself: it belongs to the
// mocap's latency.
class ClockMap {
 public:
  // Takes a frame stamped `remote_s` by the other clock that arrived at `arrival_s` ROS time; returns the ROS
  // time of the stamp. Results ascend as long as the remote stamps do. Starts anew when either clock jumps.
  double add(double remote_s, double arrival_s);

  double offset_s() const { return offset_; }  // ROS time minus remote time, at the newest frame
  double drift() const { return slope_; }      // seconds of ROS time gained per remote second, minus 1
  std::size_t restarts() const { return restarts_; }

 private:
  struct Point {
    double remote_s, delay_s;
  };
  void restart(double remote_s, double delay_s);
  void fit();

  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  std::deque<Point> points_;  // least delay of each window; the last window is still open
  double window_end_ = kNever;
  double slope_ = 0.0;
  double reference_ = 0.0, delay_ = 0.0;  // the line passes through this point
  double offset_ = 0.0;
  double last_remote_ = kNever, last_result_ = kNever;
  double late_since_ = kNever;
  std::size_t restarts_ = 0;
};

}  // namespace atmos
