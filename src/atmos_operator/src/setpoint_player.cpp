#include "atmos_operator/setpoint_player.h"

#include <algorithm>

namespace atmos {

std::vector<SetPoint> load_sequence(const std::string& path) {
  const ConfigFile file(path);
  std::vector<SetPoint> sequence = read_set_points(file.root());
  file.check();
  return sequence;
}

SetpointPlayer::SetpointPlayer(const std::vector<SetPoint>& sequence, double t0) {
  for (const SetPoint& point : sequence)
    sequence_.push_back({t0 + point.time_s, point.x_m, point.y_m, point.yaw_rad});
}

std::size_t SetpointPlayer::in_force(double now) const {
  std::size_t index = 0;
  while (index + 1 < sequence_.size() && sequence_[index + 1].stamp <= now) ++index;
  return index;
}

std::vector<StampedSetPoint> SetpointPlayer::due(double now) {
  const std::size_t end = std::min(in_force(now) + 2, sequence_.size());
  std::vector<StampedSetPoint> result;
  for (; next_ < end; ++next_) result.push_back(sequence_[next_]);
  return result;
}

std::vector<StampedSetPoint> SetpointPlayer::announced(double now) const {
  std::vector<StampedSetPoint> result;
  for (std::size_t i = in_force(now); i < std::min(in_force(now) + 2, next_); ++i)
    result.push_back(sequence_[i]);
  return result;
}

}  // namespace atmos
