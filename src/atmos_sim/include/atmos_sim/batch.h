// Flights without ROS: a scenario's plant flown open loop on a table of commands.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "atmos_model/scenario.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_sim/mocap_sensor.h"

namespace atmos {

// What is known at one mocap frame.
struct BatchRow {
  double time_s;              // ROS time
  PlanarState<double> truth;  // of the geometric centre
  MocapFrame frame;
};

struct BatchResult {
  std::vector<BatchRow> rows;
  std::uint64_t steps = 0;
  std::uint64_t unused_commands = 0;  // expired or malformed
};

// Flies the scenario from `start_s` for its duration, one row per mocap frame.
BatchResult run_batch(const Scenario& scenario, const std::vector<ThrusterCommand>& commands, double start_s);

// Commands that follow each other without a gap for the scenario's duration. Each duty is 0 or 1 with
// probability 1/8 each, otherwise uniform between.
std::vector<ThrusterCommand> random_commands(const Scenario& scenario, double start_s, std::uint64_t seed);

// Reads a table with the header `stamp_s,period_s,duty1,...,dutyN`. Throws ConfigError with every fault.
std::vector<ThrusterCommand> read_commands(const std::string& path, int thruster_count);
// Writes what read_commands reads.
void write_commands(const std::vector<ThrusterCommand>& commands, std::ostream& out);
// Writes
// `stamp_s,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,yaw_rate_rad_s,mocap_stamp_s,mocap_x_m,mocap_y_m,mocap_yaw_rad`;
// velocities in world axes, lost frames as nan.
void write_states(const BatchResult& result, std::ostream& out);

}  // namespace atmos
