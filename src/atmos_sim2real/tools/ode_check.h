// The fit put to the test in the simulator itself: a child process loads model.yaml and flies the recorded
// commands.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_model/vehicle.h"
#include "atmos_sim2real/recording.h"

namespace atmos {

// Windows of 5 s of every recording, each from a state estimated out of the past alone, in the ODE simulator
// under the nominal and the fitted model: {"simulator", "horizon_s", "windows", "nominal": {"position_rms_m",
// "yaw_rms_rad"}, "fitted", "largest_difference_m"}; the last is how far it ends from this package's own
// prediction under the fitted model. {"skipped": reason} when the simulator is not there or cannot fly the
// recording. `folder` takes the files that the child reads and writes; they are removed.
nlohmann::ordered_json ode_check(const std::vector<Recording>& recordings, const Vehicle& vehicle,
                                 const std::string& vehicle_path, const std::vector<Effect>& nominal,
                                 const std::vector<Effect>& fitted, const std::string& folder);

}  // namespace atmos
