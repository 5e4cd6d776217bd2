// Plays a sequence of set-points: each is announced one ahead, stamped with the time from which it holds.
#pragma once

#include <string>
#include <vector>

#include "atmos_model/scenario.h"

namespace atmos {

// A set-point in world W: yaw in rad, `stamp` in ROS seconds.
struct StampedSetPoint {
  double stamp = 0.0;
  double x_m = 0.0, y_m = 0.0;
  double yaw_rad = 0.0;
};

// Reads a file that holds nothing but `setpoints:`, written as in a scenario. Throws ConfigError with every
// fault.
std::vector<SetPoint> load_sequence(const std::string& path);

class SetpointPlayer {
 public:
  // `sequence` as the readers return it (not empty, ascending, first at 0); t0 is the start of the flight.
  SetpointPlayer(const std::vector<SetPoint>& sequence, double t0);

  // The set-points to announce at `now` that have not been announced yet: every one that holds, and the one
  // after it.
  std::vector<StampedSetPoint> due(double now);

  // What somebody who starts to listen at `now` must be told: the set-point that holds, and the one after it
  // if it has been announced.
  std::vector<StampedSetPoint> announced(double now) const;

  bool finished() const { return next_ == sequence_.size(); }

 private:
  std::size_t in_force(double now) const;

  std::vector<StampedSetPoint> sequence_;
  std::size_t next_ = 0;  // first one not announced
};

}  // namespace atmos
