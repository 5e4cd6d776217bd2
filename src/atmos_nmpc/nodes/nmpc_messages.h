// Conversion between the controller's types and messages.
#pragma once

#include <atmos_msgs/Disturbance.h>
#include <atmos_msgs/RateCommand.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/WrenchStamped.h>
#include <nav_msgs/Path.h>
#include <trajectory_msgs/MultiDOFJointTrajectory.h>

#include <string>
#include <vector>

#include "atmos_nmpc/controller.h"

namespace atmos {

atmos_msgs::ThrusterCommand thruster_message(const ControlDecision& decision, const std::string& frame);
geometry_msgs::WrenchStamped wrench_message(const ControlDecision& decision, const std::string& frame);
atmos_msgs::RateCommand rate_message(const ControlDecision& decision, const std::string& frame);
// Only of a decision with a disturbance.
atmos_msgs::Disturbance disturbance_message(const ControlDecision& decision);
nav_msgs::Path path_message(const ControlDecision& decision);

// Points of the first joint, stamped in ROS seconds. Velocities and accelerations that are not given are 0; a
// point without a pose has none that is finite, and trajectory_fault() says so.
std::vector<TrajectoryPoint> trajectory_points(const trajectory_msgs::MultiDOFJointTrajectory& message);

}  // namespace atmos
