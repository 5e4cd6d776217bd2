// Plans, monitors and places as messages.
#pragma once

#include <atmos_msgs/StlMonitor.h>
#include <atmos_msgs/StlPlan.h>
#include <trajectory_msgs/MultiDOFJointTrajectory.h>
#include <visualization_msgs/MarkerArray.h>

#include "atmos_stl_planner/monitor.h"
#include "atmos_stl_planner/planner.h"

namespace atmos::stl {

// The motion of one robot from `from_s` on; t0_s: ROS time at which the plan counts 0.
trajectory_msgs::MultiDOFJointTrajectory trajectory_message(const Specification& specification,
                                                            const Motion& motion, std::size_t robot,
                                                            double t0_s, double from_s);

atmos_msgs::StlPlan plan_message(const Specification& specification, const Plan& plan, double t0_s);

atmos_msgs::StlMonitor monitor_message(const Specification& specification, const Monitor& monitor,
                                       double t0_s, double time_s, const std::vector<Eigen::Vector2d>& p_WB);

// Regions with their names and windows, obstacles, and, of a plan that is not null, each robot's path,
// coloured from red (robustness 0) to green (that of the plan) by the least robustness of the always clauses
// there.
visualization_msgs::MarkerArray markers(const Specification& specification, const Plan* plan);

}  // namespace atmos::stl
