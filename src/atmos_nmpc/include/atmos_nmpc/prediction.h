// The measured state carried to the time at which a command acts, with the model and the commands in force.
#pragma once

#include "atmos_model/allocation.h"
#include "atmos_model/rigid_body.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"

namespace atmos {

// One opening or force per thruster, without allocation.
using Openings = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxThrusters, 1>;

// Motion of the rigid body from ROS time from_s to until_s under the valves' openings, exact at valve edges.
// `thrusters`: thruster_matrices(vehicle). Returns x unchanged when until_s <= from_s.
State13<double> predict(const Vehicle& vehicle, const AllocationMatrices& thrusters,
                        const ValveSchedule& valves, State13<double> x, double from_s, double until_s);

}  // namespace atmos
