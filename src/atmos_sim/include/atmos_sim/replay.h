// Recorded commands flown again in the simulator, window by window from recorded states: what the simulator
// would have said of a flight that really happened.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"
#include "atmos_sim/simulation.h"

namespace atmos {

// What the mocap showed at a stamp: the measured point, its velocity in the world, yaw and its rate.
struct ReplayStart {
  double stamp_s;
  PlanarState<double> shown;
};

// What it would show at a later stamp.
struct ReplayedPose {
  double window_start_s;
  double stamp_s;
  PlanarPose<double> shown;
};

// One window per start, a row every 0.1 s up to the horizon. The simulator runs through all commands from the
// first one on, so that hidden states (gas, plenum, thrust rise) are those of the flight; at each start the
// body is put into the state that was shown. Stamps pass the plant's mocap latency and clock skew. Throws
// std::invalid_argument when there is no command or a start lies before the first.
std::vector<ReplayedPose> replay(const Vehicle& vehicle, const std::vector<Effect>& effects,
                                 const std::vector<ThrusterCommand>& commands,
                                 const std::vector<ReplayStart>& starts, double horizon_s);

// Reads `stamp,x,y,yaw,vx,vy,yaw_rate`. Throws std::invalid_argument with file and line.
std::vector<ReplayStart> read_replay_starts(const std::string& path);
// Writes `window_start,stamp,x,y,yaw`.
void write_replay(const std::vector<ReplayedPose>& rows, std::ostream& out);

}  // namespace atmos
