// Settings of the mocap bridge (config/mocap/*.yaml).
#pragma once

#include <string>

namespace atmos {

// Standard deviations of unknown accelerations over MocapConfig::correlation_s.
struct AccelerationNoise {
  double linear_m_s2;     // > 0
  double angular_rad_s2;  // > 0
};

struct MocapConfig {
  std::string robot;                      // empty: the node's namespace
  double position_noise_m;                // > 0, 1 sigma per axis
  double attitude_noise_rad;              // > 0, 1 sigma per axis
  double correlation_s;                   // > 0
  double thrust_error;                    // >= 0, relative 1 sigma of each open valve's thrust
  AccelerationNoise known_input;          // while commands are known, besides thrust_error
  AccelerationNoise unknown_input;        // without commands
  double initial_velocity_m_s;            // > 0, 1 sigma per axis
  double initial_angular_velocity_rad_s;  // > 0, 1 sigma per axis
  double nis_gate;                        // > 0; normalised innovation squared above which a frame is refused
  int reinitialise_after;                 // >= 1 consecutive refusals
  double coast_s;                         // >= 0; predictions are published over gaps up to this
  double forget_s;                        // >= coast_s; after a longer gap the filter starts anew
};

// Throws ConfigError with every fault.
MocapConfig load_mocap_config(const std::string& path);

}  // namespace atmos
