// A recording as the diagnosis sees it: poses of one robot in the plane and what its valves were told.
#pragma once

#include <string>
#include <vector>

#include "atmos_model/valve_schedule.h"

namespace atmos {

struct PoseSample {
  double time_s;  // stamp, ROS seconds
  double x_m, y_m;
  double yaw_rad;  // unwrapped once the recording is cleaned
};

struct Recording {
  std::string name;
  std::vector<PoseSample> poses;
  std::vector<ThrusterCommand> commands;
  std::vector<std::string> warnings;  // what was wrong with the data and what was done about it

  double start_s() const { return commands.front().stamp_s; }  // t0 of the effects
  double duration_s() const { return poses.back().time_s - poses.front().time_s; }
};

// Checks raw data before anything believes it: order, repeats, NaN, frozen poses, gaps, period of the
// commands, overlap of the two streams. Drops what cannot be used, unwraps yaw, and says so in `warnings`.
// Throws std::invalid_argument with one clear sentence when nothing can be concluded: no commands, fewer than
// 2 s of poses, clocks that do not overlap, commands for another number of valves.
Recording clean_recording(Recording raw, int thruster_count);

}  // namespace atmos
