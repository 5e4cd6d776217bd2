// A flight without a ROS master as the bag that a lab would have recorded.
#pragma once

#include <string>

#include "atmos_sim/pilot.h"

namespace atmos {

// Poses, commands and set-points in the namespace `robot`. Frames in which the robot was not seen are left
// out, as most drivers do.
void write_bag(const std::string& path, const Scenario& scenario, const PilotedFlight& flight, double start_s,
               const std::string& robot);

}  // namespace atmos
