// The order in which the filter takes frames and commands in lockstep (docs/architecture.md, "Lockstep").
#pragma once

#include <deque>
#include <limits>
#include <optional>
#include <vector>

#include "atmos_mocap_bridge/pose_filter.h"

namespace atmos {

// Frames and commands arrive over two connections, whose order differs from run to run. A frame stamped in
// (t_k, t_k + period] is held until the command stamped t_k is there, and commands are released with the
// first frame after their stamp, so that the filter sees the same sequence in every run. The first frame
// needs no command.
class LockstepGate {
 public:
  explicit LockstepGate(double period_s) : period_s_(period_s) {}

  void add_frame(const PoseFrame& frame) { frames_.push_back(frame); }
  void add_command(const ThrusterCommand& command);

  struct Ready {
    std::vector<ThrusterCommand> commands;  // for the filter to take before the frame
    PoseFrame frame;
  };
  // Removes the oldest frame if nothing it needs is missing.
  std::optional<Ready> next();
  std::size_t held() const { return frames_.size(); }

 private:
  double period_s_;
  std::deque<PoseFrame> frames_;
  std::deque<ThrusterCommand> commands_;
  double newest_command_ = -std::numeric_limits<double>::infinity();
  bool first_ = true;
};

}  // namespace atmos
