// The flight controller file (config/flight_controller/*.yaml).
#pragma once

#include <string>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_model/vehicle.h"
#include "atmos_px4_bridge/pid.h"

namespace atmos {

struct FlightControllerConfig {
  PidGains rate;                // torque [N m] for a yaw rate [rad/s]
  std::vector<Effect> model{};  // what a model.yaml adds to the vehicle; empty: the nominal one
};

// Reads a flight controller file for a vehicle, and the model file it names. Throws ConfigError with every
// fault.
FlightControllerConfig load_flight_controller(const std::string& path, const Vehicle& vehicle);

}  // namespace atmos
