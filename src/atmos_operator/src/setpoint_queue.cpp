#include "atmos_operator/setpoint_queue.h"

namespace atmos {

std::optional<StampedSetPoint> SetpointQueue::at(double now) {
  auto after = points_.upper_bound(now);
  if (after == points_.begin()) return std::nullopt;
  --after;
  points_.erase(points_.begin(), after);
  return after->second;
}

}  // namespace atmos
