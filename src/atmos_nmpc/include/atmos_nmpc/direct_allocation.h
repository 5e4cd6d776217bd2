// The paper's direct control allocation (ctl:da) for a vehicle: dynamics, cost and bounds as one optimal
// control problem.
#pragma once

#include <memory>
#include <vector>

#include "atmos_model/allocation.h"
#include "atmos_nmpc/config.h"
#include "atmos_nmpc/control_law.h"
#include "atmos_nmpc/multiple_shooting.h"

namespace atmos {

using DirectAllocation = MultipleShooting<RigidBodyStep<4>>;
extern template class MultipleShooting<RigidBodyStep<4>>;  // compiled once

// The vehicle must have four thruster pairs, as load_controller() has checked.
DirectAllocation make_direct_allocation(const Vehicle& vehicle, const ControllerConfig& config);

// Duties that give pair forces u [N]: u_j > 0 opens the pair's positive thruster, u_j < 0 its negative one,
// for the share |u_j| / force of that thruster of the period; pulses under min_on_time are sent as 0.
// Propellers take u_j / force as it is.
void duties_from_pairs(const Vehicle& vehicle, const std::vector<ThrusterPair>& pairs,
                       const Eigen::Vector4d& u, std::vector<double>& duty);

std::unique_ptr<ControlLaw> make_direct_allocation_law(const Vehicle& vehicle, const ControllerConfig& config,
                                                       Stopwatch stopwatch);

}  // namespace atmos
