// In which order the inputs of a recorded flight are given to the nodes again.
#pragma once

#include <cstddef>
#include <vector>

namespace atmos {

// In the order in which they go at one instant: a goal before the frame that it may act on, a frame before
// the command that answers it.
enum class ReplayKind { kGoal, kFrame, kCommand };

struct ReplayEvent {
  double time_s = 0.0;  // ROS time at which it is due
  ReplayKind kind = ReplayKind::kFrame;
  std::size_t message = 0;  // the caller's number of it
};

// Events in time; those within 0.1 ms are of one instant, as stamps of one instant went through sums of
// doubles. Otherwise as given.
std::vector<ReplayEvent> replay_order(std::vector<ReplayEvent> events);

}  // namespace atmos
