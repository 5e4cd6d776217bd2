// What several tests share: the shipped nominal vehicle.
#pragma once

#include <string>

#include "atmos_model/vehicle.h"

namespace atmos {

inline std::string shipped(const std::string& path) { return std::string(ATMOS_ROOT) + "/" + path; }
inline Vehicle nominal_vehicle() { return load_vehicle(shipped("config/vehicle/atmos.yaml")); }

// Stateful tests start here: ROS time is never near zero.
inline constexpr double kStart = 1.7e9;

}  // namespace atmos
