// A scenario: what is flown, with which vehicle and controller, on which floor, seen by which mocap.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_model/vehicle.h"

namespace atmos {

struct SetPoint {
  double time_s;  // after the start of the flight, ascending, first at 0
  double x_m, y_m;
  double yaw_rad;  // written as yaw_deg
};

// Frames are lost in this stretch of the flight.
struct Dropout {
  double start_s;  // after the start of the flight
  double duration_s;
};

struct MocapSettings {
  double rate_hz = 100.0;
  double noise_m = 0.0;  // standard deviation per axis
  double noise_rad = 0.0;
  double publish_delay_s = 0.0;      // from exposure (the stamp) to publication; real time only
  double dropout_probability = 0.0;  // of each frame by itself
  std::vector<Dropout> dropouts;
  double distortion_m = 0.0;    // standard deviation over the floor of a smooth, steady error of position
  double stamp_jitter_s = 0.0;  // standard deviation of a stamp about the exposure
};

// What every lab has and no model describes. It makes no effect: a diagnosis has to live with it.
struct LabSettings {
  double thrust_scatter = 0.0;   // relative standard deviation from pulse to pulse, each valve by itself
  double slow_force_n = 0.0;     // standard deviation per axis (world) of a random force that drifts
  double slow_torque_n_m = 0.0;  // the same of a torque
  double slow_time_s = 4.0;      // correlation time of both
};

struct Scenario {
  std::string name;
  std::string path;          // the file it was read from
  std::string vehicle_path;  // absolute or relative to the working directory
  std::string controller_path;
  double duration_s;
  std::uint32_t seed;
  double step_s;   // simulator step
  SetPoint start;  // time_s unused
  std::vector<SetPoint> set_points;
  MocapSettings mocap;
  LabSettings lab;
  std::vector<Effect> effects;
  Vehicle vehicle;
};

// Reads the list `setpoints` of `root`; faults are recorded there. No set-point may be later than latest_s.
std::vector<SetPoint> read_set_points(const ConfigMap& root,
                                      double latest_s = std::numeric_limits<double>::infinity());

// Reads a scenario and the vehicle it names; the controller file is left to the controller. Throws
// ConfigError with every fault.
Scenario load_scenario(const std::string& path);

}  // namespace atmos
