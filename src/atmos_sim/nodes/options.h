// Private parameters of the simulator node.
#pragma once

#include <ros/node_handle.h>

#include <string>
#include <vector>

#include "atmos_model/scenario.h"
#include "atmos_model_ros/connections.h"

namespace atmos {

// See launch/sim.launch for what they mean to a user.
struct Options {
  std::vector<Scenario> fleet;  // robots of the scenario, at least one
  bool lockstep;                // clock: lockstep, or real
  double speed;                 // real clock only: ROS seconds per wall second
  double answer_limit_s;        // wall clock
  std::vector<Connection> wait_for;
  std::string summary;  // file to write at the end; empty: none
};

// Throws ConfigError with every fault.
Options read_options(const ros::NodeHandle& node);

}  // namespace atmos
