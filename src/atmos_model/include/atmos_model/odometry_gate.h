// In lockstep: whether all odometry up to a time has come, so that a rate command or the loss of a frame
// meets the same measurement in every run. Odometry and mocap/status arrive over two connections, each in
// order; the status of a frame says whether there is odometry with its stamp. Times are ROS seconds.
#pragma once

#include <limits>

namespace atmos {

class OdometryGate {
 public:
  void on_status(double stamp_s, bool published) {
    status_s_ = stamp_s;
    if (published) promised_s_ = stamp_s;
  }
  void on_odometry(double stamp_s) { odometry_s_ = stamp_s; }

  // Every frame stamped up to time_s is known, and so is its odometry.
  bool complete(double time_s) const {
    return status_s_ >= time_s - kSameInstant && odometry_s_ >= promised_s_ - kSameInstant;
  }

 private:
  static constexpr double kSameInstant = 1e-3;  // s, the grid's own tolerance
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  double status_s_ = kNever, promised_s_ = kNever, odometry_s_ = kNever;
};

}  // namespace atmos
