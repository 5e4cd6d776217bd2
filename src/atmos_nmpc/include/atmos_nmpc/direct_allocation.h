// The paper's direct control allocation (ctl:da) for a vehicle: dynamics, cost and bounds as one optimal
// control problem.
#pragma once

#include <vector>

#include "atmos_model/allocation.h"
#include "atmos_nmpc/config.h"
#include "atmos_nmpc/multiple_shooting.h"

namespace atmos {

using DirectAllocation = MultipleShooting<RigidBodyStep<4>>;

// The vehicle must have four thruster pairs, as load_controller() has checked.
DirectAllocation make_direct_allocation(const Vehicle& vehicle, const ControllerConfig& config);

// Riccati solution over the errors (x, y, yaw, vx, vy, yaw rate) of the motion about rest at yaw `yaw`, all
// stages alike. Throws std::invalid_argument where there is none (a direction without weight or without
// thruster).
TrackingCost::PlanarWeight planar_terminal_weight(const RigidBodyStep<4>& dynamics,
                                                  const TrackingWeights& weights, double force_weight,
                                                  double yaw);

// Duties that give pair forces u [N]: u_j > 0 opens the pair's positive thruster, u_j < 0 its negative one,
// for the share |u_j| / force of that thruster of the period; pulses under min_on_time are sent as 0.
std::vector<double> duties_from_pairs(const Vehicle& vehicle, const std::vector<ThrusterPair>& pairs,
                                      const Eigen::Vector4d& u);

}  // namespace atmos
