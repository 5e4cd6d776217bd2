#include "atmos_mocap_bridge/lockstep_gate.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

constexpr double kGrid_s = 1e-3;  // stamps lie this near to the PWM grid

}  // namespace

void LockstepGate::add_command(const ThrusterCommand& command) {
  commands_.push_back(command);
  newest_command_ = std::max(newest_command_, command.stamp_s);
}

std::optional<LockstepGate::Ready> LockstepGate::next() {
  if (frames_.empty()) return std::nullopt;
  const double stamp = frames_.front().stamp_s;
  const double needed = (std::ceil((stamp - kGrid_s) / period_s_) - 1.0) * period_s_;
  if (!first_ && newest_command_ < needed - kGrid_s) return std::nullopt;
  first_ = false;

  Ready ready{{}, frames_.front()};
  frames_.pop_front();
  while (!commands_.empty() && commands_.front().stamp_s <= needed + kGrid_s) {
    ready.commands.push_back(commands_.front());
    commands_.pop_front();
  }
  return ready;
}

}  // namespace atmos
