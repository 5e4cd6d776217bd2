// The listener's side of set-points that are announced ahead of time.
#pragma once

#include <map>
#include <optional>

#include "atmos_operator/setpoint_player.h"

namespace atmos {

class SetpointQueue {
 public:
  // One with the stamp of an earlier one replaces it.
  void add(const StampedSetPoint& point) { points_[point.stamp] = point; }

  // The set-point that holds at `now` (ROS seconds); none before the first stamp. Forgets those it replaced.
  std::optional<StampedSetPoint> at(double now);

 private:
  std::map<double, StampedSetPoint> points_;
};

}  // namespace atmos
